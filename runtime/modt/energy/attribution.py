"""Attribution of energy to idling and the stages. Reports, pages and the status all split energy by this rule.

A board is described by E_window = P_idle T + e_seg N_seg + e_class N_class + e_point N_point.
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

    With P_idle of the board, E and T of the window and t of its CPU time, in all and of a stage,

        E_idle = min(P_idle T, E)
        E_stage = (E - E_idle) t_stage / t

    A reading of a calibrated board is split by the coefficients instead: E_idle = P_idle T,
    E_segmentation = e_seg N_seg, E_classification = e_class N_class + e_point N_point, the rest is unattributed.
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
