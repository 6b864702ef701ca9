"""Tuning of the comparison of k-DOPs."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ShapeTuning:
    """Comparison of k-DOPs. The kernels hold it, for every stage that compares some."""

    end_jitter_m: float = 0.15
    """Jitter of the ends of a k-DOP from frame to frame [m]. Coverage extends the covering k-DOP by it, and no k-DOP
    counts as narrower. Greater: parts outside an object are taken for parts of it.
    Chosen on: judgement."""

    width_softening_m: float = 0.3
    """Added to widths before their logarithms are compared [m], since a difference of a few returns is noise.
    Greater: the sizes of small objects differ less.
    Chosen on: judgement."""

    area_padding_m: float = 0.3 / 3
    """Added to widths before areas are compared [m]. Greater: thin k-DOPs beside each other overlap.
    Chosen on: judgement, a third of `width_softening_m`."""

    agreement_m: float = 0.6
    """Difference between the displacements of both ends along an axis from which they do not agree at all [m]. It is
    divided by the length of a k-DOP that is longer than a metre. Greater: an end that comes into view is taken for
    motion.
    Chosen on: simulated crossings and streets, by the error of positions and of walkers' speeds."""

    disagreement: float = 0.3
    """Standard deviation of a displacement by ends that disagree, relative to the disagreement, or to the width if
    that is less; of a car of which less than half is seen, also relative to the part of its known width that is
    not seen. Greater: the filter trusts such axes less.
    Chosen on: simulated drives, by the consistency of the filter (NEES)."""

    near_cosine: float = 0.5
    """Cosine of the angle between an axis and the line of sight from which one end along the axis is nearer to the
    sensor, and measures displacements. Less: the near side of what is seen across is taken for its end.
    Chosen on: simulated streets with vehicles that accelerate, by the error of velocities."""

    near_disagreement: float = 0.05
    """As `disagreement`, where the nearer end measures along the line of sight; the more oblique an axis, the nearer
    it is to `disagreement`. Greater: what grows in view is followed later.
    Chosen on: simulated streets with vehicles that accelerate, by the error of velocities."""

    end_variance_decay: float = 0.97
    """Share of the variance by ends that disagreed that is left a frame later.
    Chosen on: simulated drives, by the consistency of the filter (NEES)."""
