"""A classifier that a program brings, in place of the network."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from modt.classes import CLASS_NAMES, N_CLASSES
from modt.errors import MisuseError
from modt.types import Float32, Float64, Int, Proposals

Classifier = Callable[[Sequence[Float32]], ArrayLike]
"""Function of the points of R proposals, each (n, 4) x, y, z [m, level sensor frame], reflectance [0, 1]. It returns
(R, C) likelihoods P(points | class), in the order of CLASS_NAMES, each row up to a factor."""


class OwnClassifier:
    """Posteriors by a function, for a scene with given class frequencies.

    Args:
        function: gives likelihoods.
        class_frequency: (C,) frequencies of the classes that the posteriors assume.
    """

    def __init__(self, function: Classifier, class_frequency: Float64) -> None:
        self._function = function
        self._class_frequency = class_frequency

    def classify(self, points: Float32, proposals: Proposals, which: Int) -> Float64:
        """(R, C) class probabilities of the given proposals, in their order.

        Args:
            points: (N, 4) points of the frame.
            proposals: proposals of the frame.
            which: (R,) proposals to classify.

        Raises:
            MisuseError: the function returned no likelihoods.
        """
        first = proposals.offsets[which]
        last = proposals.offsets[which + 1]
        clouds = [points[proposals.members[a:b]] for a, b in zip(first, last, strict=True)]
        likelihood = np.asarray(self._function(clouds), np.float64)
        if likelihood.shape != (len(which), N_CLASSES):
            self._refuse(f"returned an array of shape {likelihood.shape} for {len(which)} proposals")
        if not np.isfinite(likelihood).all() or likelihood.min() < 0 or not likelihood.any(axis=1).all():
            self._refuse("returned a row that is negative, not finite or zero")
        weighted = likelihood * self._class_frequency
        posterior: Float64 = weighted / weighted.sum(axis=1, keepdims=True)
        return posterior

    def facts(self) -> dict[str, str]:
        """Name of the function, for the record of a run."""
        return {"file": self._name, "sha256": "unavailable"}

    @property
    def _name(self) -> str:
        return str(getattr(self._function, "__qualname__", repr(self._function)))

    def _refuse(self, cause: str) -> None:
        remedy = f"return a row of likelihoods of {', '.join(CLASS_NAMES)} for each proposal"
        raise MisuseError(f"classifier {self._name}", cause, remedy)
