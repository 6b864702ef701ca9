"""Records of a run, read back line by line."""

from __future__ import annotations

import json
import logging
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

from modt.energy.ledger import SCHEMA as LEDGER_SCHEMA
from modt.energy.ledger import LedgerLine, StageWork
from modt.energy.meters.meter import Kind, Scope
from modt.energy.windows import SCHEMA as ENERGY_SCHEMA
from modt.energy.windows import EnergyWindow, MeterEnergy
from modt.errors import MisuseError, refuse_pipe
from modt.sinks.records import records_of

log = logging.getLogger(__name__)


def read_records(path: Path, schema: str, ignored: Collection[str] = ()) -> Iterator[dict[str, Any]]:
    """Records of a schema, in order, without an incomplete last line of an aborted run.

    The file may still be growing; records of ignored schemas are skipped.

    Raises:
        MisuseError: missing, unreadable, or of another schema; the error names the line.
    """
    try:
        refuse_pipe(path, "give the directory of a run")
        with path.open(encoding="utf-8") as lines:
            for number, text in enumerate(lines, 1):
                try:
                    record = json.loads(text)
                except (ValueError, RecursionError):
                    if text.endswith("\n"):
                        raise MisuseError(f"{path}:{number}", "no JSON", "give a file that modt wrote") from None
                    log.warning("%s:%d: incomplete last line ignored", path, number)
                    return
                found = record.get("schema") if isinstance(record, dict) else None
                if found in ignored:
                    continue
                if found != schema:
                    remedy = f"this version reads {schema}"
                    raise MisuseError(f"{path}:{number}", f"schema is {found!r}", remedy)
                yield record
    except (OSError, UnicodeDecodeError) as error:
        raise MisuseError(path, f"cannot be read ({error})", "give the directory of a run") from None


def read_ledger(path: Path) -> Iterator[LedgerLine]:
    """The costs of the frames in a ledger.jsonl.

    Raises:
        MisuseError: as read_records, or a line is incomplete.
    """
    for record in read_records(path, LEDGER_SCHEMA, ignored={ENERGY_SCHEMA}):
        with records_of(path):
            line = LedgerLine(**{**record, "stages": _stages(record)})
        yield line


def read_windows(path: Path) -> Iterator[EnergyWindow]:
    """The windows of energy in a ledger.jsonl.

    Raises:
        MisuseError: as read_records, or a line is incomplete.
    """
    for record in read_records(path, ENERGY_SCHEMA, ignored={LEDGER_SCHEMA}):
        with records_of(path):
            meters = [MeterEnergy(m["name"], Kind(m["kind"]), Scope(m["scope"]), m["J"]) for m in record["meters"]]
            parsed = {"frames": tuple(record["frames"]), "kind": Kind(record["kind"]), "meters": meters}
            window = EnergyWindow(**{**record, **parsed, "stages": _stages(record)})
        yield window


def _stages(record: dict[str, Any]) -> dict[str, StageWork]:
    return {stage: StageWork(**work) for stage, work in record["stages"].items()}
