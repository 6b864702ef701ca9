"""Preload of a Dask worker: the first worker that has written tracks is killed before the run is committed."""

import os
import signal
from pathlib import Path

from modt_batch.dataset import Dataset


def put(self: Dataset, place: str, content: bytes) -> None:
    write(self, place, content)
    if place.startswith("tracks/"):
        try:
            Path(os.environ["KILLED"]).touch(exist_ok=False)
        except FileExistsError:
            return
        os.kill(os.getpid(), signal.SIGKILL)


if Dataset.put.__module__ == Dataset.__module__:  # Dask loads this file twice
    write = Dataset.put
    Dataset.put = put
