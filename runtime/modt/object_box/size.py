"""Sizes of whole objects, from the sides that were seen."""

from __future__ import annotations

import numpy as np

from modt.class_sizes import IS_WALKER, MAX_SIZE_M, USUAL_SIZE_M, USUAL_SPREAD_M
from modt.object_box.seen import Seen
from modt.object_box.tuning import SizeTuning
from modt.types import Float64, ObjectBoxes


def whole_size_m(state: ObjectBoxes, seen: Seen, extent_m: Float64, tuning: SizeTuning) -> Float64:
    """(R, 3) length, width and height, given the extents (R, 3) that the frame shows [m].

    The known size follows a larger extent fast and a smaller one slowly; what is larger than the class allows is
    taken for merged objects, and changes nothing. A side is seen whole, or an unknown part of it. The nearer its
    known length is to the usual one, the likelier it is whole. The estimate of a whole side lies between both
    lengths, by their uncertainties. That of a part is the usual length, or the known one if it is longer.
    """
    class_ = seen.object_class
    change_m = extent_m - state.known_m
    share = np.where(change_m > 0, tuning.growth, tuning.shrinkage)
    share[(extent_m[:, :2] > MAX_SIZE_M.take(class_, axis=0)).any(axis=1)] = 0.0
    share[~state.estimated] = 1.0
    state.known_m[:] += share * change_m
    usual_m = USUAL_SIZE_M.take(class_, axis=0)
    usual_m[:, 0] += tuning.stride_m * (seen.moving & IS_WALKER[class_])
    spread_m = USUAL_SPREAD_M.take(class_, axis=0)
    more_m = state.known_m - usual_m
    missing = np.maximum(-more_m, 0.0) / spread_m
    part = 1 + missing * missing
    whole = 1 / (1 + tuning.doubt * (part * part))
    noise_m = np.array([tuning.length_noise_m, tuning.width_noise_m, tuning.height_noise_m])
    # Weight of what is seen against the usual length, by their variances.
    trust = spread_m * spread_m / (spread_m * spread_m + noise_m * noise_m)
    at_least_m = np.maximum(more_m, 0.0)
    size_m: Float64 = usual_m + (at_least_m + whole * (trust * more_m - at_least_m))
    return size_m
