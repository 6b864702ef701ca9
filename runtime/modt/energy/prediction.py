"""Energy saved by tracking, as the paper predicts it (section IV-D, Equations 2 and 3).

All energies share one unit, which cancels in gamma: joules where a meter was read, CPU seconds otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class PaperModel:
    """The quantities of Equations 2 and 3.

    Attributes:
        e_seg: E(seg), of one segmentation call.
        e_class: E(class), of the classification of one proposal.
        n_obj: N_obj, foreground proposals a frame.
        n_bg: N_bg, background proposals a frame.
        n_go: N_go, mean life of a track in frames.
    """

    e_seg: float
    e_class: float
    n_obj: float
    n_bg: float
    n_go: float

    @property
    def a(self) -> float:
        """E(class) / E(seg); infinite where segmentation costs nothing."""
        return self.e_class / self.e_seg if self.e_seg else float("inf")

    def e1(self, m: int) -> float:
        """E1(M): tracking-by-detection over M frames (Equation 2)."""
        return m * self.e_seg + m * (self.n_obj + self.n_bg) * self.e_class

    def e2(self, m: int) -> float:
        """E2(M): one classification a track over M frames (Equation 2)."""
        return m * self.e_seg + m / self.n_go * (self.n_obj + self.n_bg) * self.e_class

    @property
    def gamma(self) -> float:
        """E1(M) / E2(M), independent of M (Equation 3, first line); 1 where nothing costs anything."""
        e2 = self.e2(1)
        return self.e1(1) / e2 if e2 else 1.0

    @property
    def gamma_short(self) -> float:
        """The paper's approximation gamma = N_go."""
        return self.n_go

    @property
    def short_form_error(self) -> float:
        """Relative error of gamma = N_go at this a, against the full Equation 3."""
        return self.gamma_short / self.gamma - 1.0


def gamma(a: float, n: float, n_go: float) -> float:
    """Equation 3, second line, with a = E(class) / E(seg), n = N_obj + N_bg proposals a frame, and N_go [frames]."""
    return (1.0 + n * a) / (1.0 + n * a / n_go)
