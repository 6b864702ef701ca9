"""Attribution of energy to idling and the stages. Reports, pages and the status all split energy by this rule.

A board is described by keys of its profile: E_window = idle_W T + seg_J N_seg + class_J N_class + point_J N_points.
"""

from __future__ import annotations

from modt.config import EnergyConfig
from modt.energy.ledger import StageWork
from modt.energy.meters.meter import Kind
from modt.energy.windows import EnergyWindow

SEGMENTATION = "segmentation"
CLASSIFICATION = "classification"
_HARMLESS_MARKS = frozenset({"wrap"})
_MAX_W = 10_000.0
"""Power above which the record of a window is not accepted [W]."""


def usable(window: EnergyWindow) -> bool:
    """Whether a window has a plausible reading and no mark that forbids its use."""
    if window.energy_J is None or not _HARMLESS_MARKS.issuperset(window.marks):
        return False
    return 0.0 <= window.energy_J <= _MAX_W * 1e-9 * window.wall_ns


def attribute(window: EnergyWindow, board: EnergyConfig) -> dict[str, float]:
    """Energy of idling, of each stage, and of the unattributed rest of a window [J], or nothing without a reading.

    With the energy E, the length T and the CPU time t of the window, of which each stage took t_stage,

        E_idle = min(idle_W T, E)
        E_stage = (E - E_idle) t_stage / t

    A reading of a calibrated board is split by the coefficients instead: E_idle = idle_W T,
    E_segmentation = seg_J N_seg, E_classification = class_J N_class + point_J N_points, the rest is unattributed.
    The parts sum to E.
    """
    energy_J = window.energy_J
    if energy_J is None:
        return {}
    idle_J = board.idle_W * 1e-9 * window.wall_ns
    if board.coefficients is not None and window.kind is not Kind.ESTIMATED:
        seg_J, class_J, point_J = board.coefficients
        segmented = window.stages.get(SEGMENTATION, StageWork())
        classified = window.stages.get(CLASSIFICATION, StageWork())
        parts = {
            "idle": idle_J,
            SEGMENTATION: seg_J * segmented.calls,
            CLASSIFICATION: class_J * classified.items + point_J * classified.points,
        }
        return parts | {"unattributed": energy_J - sum(parts.values())}
    cpu_ns = {stage: work.cpu_ns for stage, work in window.stages.items()}
    cpu_ns["unattributed"] = max(window.process_ns - sum(cpu_ns.values()), 0)
    total_ns = sum(cpu_ns.values())
    if not total_ns:
        return {"idle": energy_J}
    idle_J = min(idle_J, energy_J)
    return {"idle": idle_J, **{name: (energy_J - idle_J) * ns / total_ns for name, ns in cpu_ns.items()}}
