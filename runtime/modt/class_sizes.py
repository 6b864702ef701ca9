"""Sizes of the classes as arrays, and the test whether something may be a person by its size."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modt.classes import CLASSES, PERSON_HEIGHT_M, ClassKind, ObjectClass
from modt.types import NONE, Bool, Cut, Float32, Float64, FrameResult

MAX_SIZE_M: Float64 = np.array([(spec.max_length_m, spec.max_width_m) for spec in CLASSES])
"""(4, 2) greatest length and width of each class."""
USUAL_SIZE_M: Float64 = np.array([spec.usual_m for spec in CLASSES])
"""(4, 3) usual length, width and height of each class."""
USUAL_SPREAD_M: Float64 = np.array([spec.spread_m for spec in CLASSES])
"""(4, 3) their deviations."""
MAX_CAR_M = CLASSES[ObjectClass.CAR].max_length_m
"""Length of the longest car."""
MAX_PERSON_M = CLASSES[ObjectClass.PEDESTRIAN].max_length_m
"""Length of the longest pedestrian."""
USUAL_CAR_M = 5.5, 2.2
"""Length and width that most cars do not exceed; larger ones would hold a car and its neighbour as well."""
IS_PERSON: Bool = np.array([spec.person for spec in CLASSES])
"""(4,) whether the class is or carries a person, which is never part of a larger object."""
IS_WALKER: Bool = np.array([spec.kind is ClassKind.WALKER for spec in CLASSES])
"""(4,) whether the class is a person on foot."""
IS_RIDER: Bool = np.array([spec.kind is ClassKind.RIDER for spec in CLASSES])
"""(4,) whether the class is a vehicle with a person on it."""
IS_VEHICLE: Bool = np.array([spec.kind is ClassKind.VEHICLE for spec in CLASSES])
"""(4,) whether the class is a vehicle, which is rigid."""
HAS_PARTS: Bool = IS_VEHICLE | IS_RIDER
"""(4,) whether new parts are joined to an object of the class."""
WHOLE_SIZE_M: Float64 = np.where(IS_VEHICLE[:, None], USUAL_CAR_M, MAX_SIZE_M)
"""(4, 2) length and width that parts joined into an object of each class do not exceed."""


@dataclass(frozen=True)
class PersonSize:
    """Exclusive bounds on the size of a possible person. They depend on what is measured and what an error costs."""

    max_extent_m: float
    """Greatest extent seen from above [m]. Less takes people in stride for other things.
    Chosen on: sensor study for parts, thinned KITTI scans for strips, posed people for who is hidden or raised."""
    min_height_m: float
    """Least height of the visible part [m]. Less takes bags and strips of cars for people.
    Chosen on: sensor study for parts, thinned KITTI scans for strips, posed people for who is hidden or raised."""
    min_top_m: float = -np.inf
    """Least height of the top above the ground [m]. More misses children.
    Chosen on: sensor study for parts, thinned KITTI scans for strips, posed people for who is hidden or raised."""
    max_top_m: float = np.inf
    """Greatest height of the top above the ground [m]. Less misses tall people on a kerb.
    Chosen on: sensor study."""
    min_extent_m: float = -np.inf
    """Least extent seen from above [m]. Less takes posts for people. Chosen on: sensor study."""

    def fits(self, extent_m: Float32 | Float64, bottom_m: Float32 | Float64, top_m: Float32 | Float64) -> Bool:
        """(k,) which objects may be a person, by (k,) extent from above, bottom and top."""
        fits: Bool = (extent_m > self.min_extent_m) & (extent_m < self.max_extent_m)
        fits &= (top_m > self.min_top_m) & (top_m < self.max_top_m) & (top_m - bottom_m > self.min_height_m)
        return fits


SPLIT_PERSON = PersonSize(1.3, min_height_m=0.5, min_top_m=1.1, max_top_m=2.2, min_extent_m=0.2)
"""Bounds for a part that is split off a cluster, from a child of five to a tall person in stride on a kerb."""
STRIP_PERSON = PersonSize(0.9, min_height_m=0.7, min_top_m=1.1)
"""Bounds for a strip that is not merged into a car. Its extent is its width across the ray."""
HIDDEN_PERSON = PersonSize(0.75, min_height_m=0.2, min_top_m=1.35, max_top_m=2.2)
"""Bounds for head and shoulders behind something that hides the rest, as a counter does. What is wider may be the
roof of a car behind its bonnet."""
RAISED_PERSON = PersonSize(1.0, min_height_m=0.9, min_top_m=2.0, max_top_m=2.45, min_extent_m=0.3)
"""Bounds for a person on a platform, whose top is higher above the ground that is seen than people are tall. Parts of
trees and signs are higher."""
PART_PERSON = PersonSize(MAX_PERSON_M, min_height_m=1.0)
"""Bounds for a proposal that is not merged into background, from a child of five on."""


def unknown_near(result: FrameResult) -> Bool:
    """(M,) visible background tracks that may be people: less than half of a person's height is in view."""
    proposals = result.proposals
    length_m = proposals.box[:, 3]
    height_m = proposals.box[:, 5]
    may_be_person = (proposals.cut & Cut.TOP > 0) & (height_m < PERSON_HEIGHT_M / 2) & (length_m < MAX_PERSON_M)
    visible = result.tracks.proposal != NONE
    unknown: Bool = visible & (result.tracks.object_class == ObjectClass.BACKGROUND)
    unknown[unknown] = may_be_person[result.tracks.proposal[unknown]]
    return unknown


def doubtful(result: FrameResult) -> Bool:
    """(M,) tracks that are reported as an object whose posterior is below one half."""
    class_ = result.tracks.object_class
    doubtful: Bool = (result.tracks.posterior[np.arange(len(class_)), class_] < 0.5) & (class_ > 0)
    return doubtful
