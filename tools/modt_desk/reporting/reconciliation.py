"""The reconciled gamma as part of a report, and the columns of the pipeline's stages that it is made of."""

from __future__ import annotations

from typing import Any

from modt.pipeline import CLASSIFICATION, FUSION, ODOMETRY, SCHEDULING, SEGMENTATION, STAGES, TRACKING
from modt_desk.energy.savings import Reconciliation
from modt_desk.reporting.quantity import estimate

SEG, CLASS = STAGES.index(SEGMENTATION), STAGES.index(CLASSIFICATION)
TRACK = [STAGES.index(ODOMETRY), STAGES.index(TRACKING)]
SCHEDULE = [STAGES.index(SCHEDULING), STAGES.index(FUSION)]


def reconciliation_tree(found: Reconciliation, gamma: float | None) -> dict[str, Any]:
    """The paper's figures, the reconciled gamma, and the terms from N_go to the gamma of the runs."""
    return {
        "a": estimate(found.paper.a),
        "gamma_short": estimate(found.paper.n_go),
        "gamma_equation_3": estimate(found.paper.gamma),
        "gamma_reconciled": estimate(found.model.gamma),
        "terms": [
            {"name": term.name, "change": estimate(term.change), "gamma": estimate(term.gamma)}
            for term in found.explain(1.0 if gamma is None else gamma)
        ],
    }
