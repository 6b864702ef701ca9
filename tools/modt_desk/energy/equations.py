"""Energy of tracking-by-detection and of the proposed pipeline (section IV-D, Equations 2 and 3).

All energies share one unit, which cancels in gamma: joules where a meter was read, CPU seconds otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class EnergyModel:
    """Equations 2 and 3 by their four parameters; the others, neutral by default, are costs that they leave out.

    In names, 1 is tracking-by-detection and 2 the proposed pipeline.
    """

    e_seg: float  # E(seg), of one segmentation
    e_class: float  # E(class), of one classification by tracking-by-detection
    n: float  # N_obj + N_bg, proposals a frame
    n_go: float  # N_go, mean life of a track in frames
    classified_share: float = 1.0  # of the tracks, at least once
    repeats: float = 0.0  # further classifications a track, without those after a loss
    reacquired: float = 0.0  # further classifications a track after it was lost
    view_cost_ratio: float = 1.0  # E(class) of the views selected over e_class
    track: float = 0.0  # common to both runs, a frame
    extra_track1: float = 0.0  # beyond that
    extra_track2: float = 0.0
    schedule1: float = 0.0  # scheduling and fusion, a frame
    schedule2: float = 0.0

    @property
    def a(self) -> float:
        """E(class) / E(seg); infinite where segmentation costs nothing."""
        return self.e_class / self.e_seg if self.e_seg else float("inf")

    @property
    def views(self) -> float:
        """k: classifications a track; 1 in the paper."""
        return self.classified_share + self.repeats + self.reacquired

    @property
    def e1(self) -> float:
        """E1(M) / M: energy a frame of tracking-by-detection (Equation 2)."""
        return self.e_seg + self.n * self.e_class + self.track + self.extra_track1 + self.schedule1

    @property
    def e2(self) -> float:
        """E2(M) / M: energy a frame with n / N_go new tracks, each classified k times (Equation 2)."""
        selected = self.n / self.n_go * self.views * self.view_cost_ratio * self.e_class
        return self.e_seg + selected + self.track + self.extra_track2 + self.schedule2

    @property
    def gamma(self) -> float:
        """E1 / E2 (Equation 3); 1 where nothing costs anything."""
        return self.e1 / self.e2 if self.e2 else 1.0

    @property
    def short_form_error(self) -> float:
        """Relative error of the approximation gamma = N_go."""
        return self.n_go / self.gamma - 1.0
