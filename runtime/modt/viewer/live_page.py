"""The sink view://, the live page of a run."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np

from modt.address import Address
from modt.energy.ledger import LedgerLine
from modt.energy.windows import EnergyWindow
from modt.errors import MisuseError
from modt.sinks.records import line
from modt.types import FrameResult, PointKind
from modt.viewer import theme
from modt.viewer.html_page import LIVE, content, page, trust_text
from modt.viewer.live_server import LiveServer
from modt.viewer.packed import LEVEL_M, LEVELS, SIDE, Cells, group_of, occupied, packed_cells, packed_table
from modt.viewer.track_rows import planar, result_rows, scaled

log = logging.getLogger(__name__)

PORT = 8766
LOCAL = "127.0.0.1"


class LivePage(LiveServer):
    """Publishes each frame with its cost to the open pages, once its line of the ledger arrives."""

    def __init__(self, host: str, port: int) -> None:
        head, tail = page("modt", "waits for a sweep", content([], None, STEP_CM), LIVE)
        super().__init__(host, port, (head + tail).encode())
        self._result: FrameResult | None = None
        self._energy: dict[str, Any] = {}
        self._status = ""
        self._silent = True  # no frame since the last status

    def status(self, words: str, metrics: str, /) -> None:
        """Show the status in the head of the pages, with the next frame or, without one, by itself."""
        self.metrics = metrics.encode()
        self._status = words
        if self._silent and self.watched:
            self.publish(line({"status": words}))
        self._silent = True

    def write(self, result: FrameResult, /) -> None:
        """Keep a frame until its line of the ledger arrives."""
        self._result = result if self.watched else None
        self._silent = False

    def ledger(self, line: LedgerLine | EnergyWindow, /) -> None:
        """Take the line of a frame, or the energy of the frames of a window."""
        if isinstance(line, EnergyWindow):
            if line.frame_J is not None:
                self._energy = {"energy_mJ": 1e3 * line.frame_J, "kind": line.kind}
            return
        result = self._result
        self._result = None
        if result is not None and result.frame.index == line.frame:
            cpu_ms = {stage: round(1e-6 * work.cpu_ns, 3) for stage, work in line.stages.items()}
            self.publish(live_message(result, {"cpu_ms": cpu_ms, **self._energy}, self._status))


def open_view(address: Address) -> LivePage:
    """Open the live page, by default at 127.0.0.1, which no other machine reaches.

    Raises:
        MisuseError: it cannot be bound.
    """
    host = address.host or LOCAL
    try:
        opened = LivePage(host, PORT if address.port is None else address.port)
    except OSError as error:
        remedy = "give a host of this machine and a free port, view://HOST:PORT"
        raise MisuseError(address.text, f"cannot be bound ({error.strerror or error})", remedy) from None
    log.warning("the run is shown at http://%s:%d/", f"[{host}]" if ":" in host else host, opened.port)
    return opened


STEP_CM = 5
"""Width of a cell of the points [cm]."""
MOST_CELLS = 50_000
"""Greatest number of cells of a frame; those of the ground are left out first."""
FASTEST = 1
"""Level of the fastest compression."""


def live_message(result: FrameResult, costs: dict[str, Any], status: str) -> str:
    """Line of JSON for a frame, with the status of the run."""
    frame = {
        "frame": result.frame.index,
        "stamp_s": round(result.frame.stamp_s, 3),
        "proposals": len(result.proposals),
        "classifications": len(result.classified),
        "deferred": result.n_deferred,
        "trust": trust_text(result.trust.record()),
        "pose": planar(result.T_world_sensor).round(4).tolist(),
        **costs,
    }
    content = {
        "status": status,
        "frame": frame,
        "states": theme.states(result.state_names),
        "tracks": packed_table(scaled(result_rows(result)), FASTEST),
        "points": packed_cells(live_cells(result).thinned(MOST_CELLS), FASTEST),
    }
    return line(content)


def live_cells(result: FrameResult) -> Cells:
    """Cells of the sweep. The ground is taken as level."""
    x, y, z = (result.frame.points[:, k] for k in range(3))
    reach_m = (SIDE // 2 - 1) * STEP_CM / 100
    used = (np.abs(x) < reach_m) & (np.abs(y) < reach_m) & ((x != 0) | (y != 0))
    kind = result.proposals.kind
    if kind is None:
        kind = np.full(len(x), PointKind.GROUND, np.int8)
        kind[result.proposals.members] = PointKind.MEMBER
    is_ground = kind == PointKind.GROUND
    floor_m = float(np.median(z[used & is_ground])) if (used & is_ground).any() else 0.0
    level = np.clip(np.rint((z - floor_m) / LEVEL_M), 1, LEVELS - 1).astype(np.int64)
    level[is_ground] = 0
    return occupied(x[used], y[used], level[used], group_of(kind[used]), STEP_CM)
