"""Attribution of energy to idling and the stages. Reports, pages and the status all split energy by this rule.

A board is described by E_window = P_idle T + e_seg N_seg + e_class N_class + e_point N_point.
"""

from __future__ import annotations

from modt.config import EnergyConfig
from modt.energy.ledger import NO_WORK, Line
from modt.energy.meters.meter import Kind

SEGMENTATION, CLASSIFICATION = "segmentation", "classification"
_HARMLESS_MARKS = frozenset({"wrap"})
_MAX_W = 10_000.0
"""Power above which the record of a window is not believed [W]."""


def usable(line: Line) -> bool:
    """Whether a window has a plausible reading and no mark that forbids its use."""
    energy_J = line["energy_J"]
    known = energy_J is not None and _HARMLESS_MARKS.issuperset(line.get("marks", ()))
    return known and 0.0 <= energy_J <= _MAX_W * 1e-9 * line["wall_ns"]


def attribute(line: Line, board: EnergyConfig) -> dict[str, float]:
    """Energy of idling, of each stage, and of the unattributed rest of a window [J], or nothing without a reading.

    With P_idle of the board, E and T of the window and t of its CPU time, in all and of a stage,

        E_idle = min(P_idle T, E)
        E_stage = (E - E_idle) t_stage / t

    A reading of a calibrated board is split by the coefficients instead: E_idle = P_idle T,
    E_segmentation = e_seg N_seg, E_classification = e_class N_class + e_point N_point, the rest is unattributed.
    The parts sum to E.
    """
    energy_J = line["energy_J"]
    if energy_J is None:
        return {}
    idle_J, stages = board.idle_W * 1e-9 * line["wall_ns"], line["stages"]
    if board.coefficients is not None and line["kind"] != Kind.ESTIMATED:
        seg_J, class_J, point_J = board.coefficients
        segmented, classified = (stages.get(stage, NO_WORK) for stage in (SEGMENTATION, CLASSIFICATION))
        parts = {
            "idle": idle_J,
            SEGMENTATION: seg_J * segmented["calls"],
            CLASSIFICATION: class_J * classified["items"] + point_J * classified["points"],
        }
        return parts | {"unattributed": energy_J - sum(parts.values())}
    cpu_ns = {stage: row["cpu_ns"] for stage, row in stages.items()}
    cpu_ns["unattributed"] = max(line["process_ns"] - sum(cpu_ns.values()), 0)
    total_ns = sum(cpu_ns.values())
    if not total_ns:
        return {"idle": energy_J}
    idle_J = min(idle_J, energy_J)
    return {"idle": idle_J, **{name: (energy_J - idle_J) * ns / total_ns for name, ns in cpu_ns.items()}}
