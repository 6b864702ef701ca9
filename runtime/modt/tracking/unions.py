"""Proposals made one: a proposal, the host, takes in others, its parts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from modt.geometry import boxes_about, transform, transform_boxes
from modt.observations import Observations
from modt.tracking.association import Matches
from modt.types import NONE, Bool, Float64, Int, Proposals


@dataclass(frozen=True, slots=True)
class Unions:
    """Which of P proposals become one: U unions of F of them, Q proposals in all.

    Attributes:
        order: (P,) the proposals, each host and its parts side by side, hosts in their order.
        starts: (Q,) where in that order those begin that become each of the new ones.
        kept: (Q,) the proposals that go on, hosts for their unions.
        new: (U,) numbers of the unions, ascending.
        few: (F,) the proposals of which they consist, side by side.
        begins: (U,) where in these each begins.
        union: (F,) which of the unions each of them is of, ascending.
    """

    order: Int
    starts: Int
    kept: Int
    new: Int
    few: Int
    begins: Int
    union: Int

    @classmethod
    def of(cls, n: int, hosts: Int, parts: Int) -> Self:
        """Those of n proposals in which hosts (k,) take in parts (k,), none of these twice, or a host itself."""
        into = np.arange(n)
        into[parts] = hosts
        order = into.argsort(kind="stable")
        group = into[order]
        kept = np.ones(n, np.bool_)
        kept[parts] = False
        of_union = np.zeros(n, np.bool_)
        of_union[hosts] = True
        few = of_union[group].nonzero()[0]
        first = _first(group[few])
        new, begins = of_union[kept].nonzero()[0], first.nonzero()[0]
        return cls(
            order=order,
            starts=_first(group).nonzero()[0],
            kept=kept.nonzero()[0],
            new=new,
            few=order[few],
            begins=begins,
            union=first.cumsum() - 1,
        )

    @property
    def hosts(self) -> Int:
        """(U,) the proposals that take in others."""
        return self.kept[self.new]

    def stretches(self, offsets: Int) -> list[slice]:
        """Where the members of the proposals are, P of such offsets, in that order: few long ones are copied fast."""
        begin = _first(self.order - np.arange(len(self.order)))
        end = np.concatenate([begin[1:], begin[:1]])
        firsts, afters = offsets[self.order[begin]].tolist(), offsets[self.order[end] + 1].tolist()
        return [slice(*ends) for ends in zip(firsts, afters, strict=True)]

    def share(self, count: Int) -> Float64:
        """(F,) part of its union that each of the few is, of P proposals that have so many points."""
        own = count[self.few]
        part: Float64 = own / np.bincount(self.union, own)[self.union]
        return part

    def mean(self, values: Float64, share: Float64) -> Float64:
        """(U, k) means over the few, by their shares (F,), of values (P, k)."""
        mean: Float64 = np.add.reduceat(values.take(self.few, axis=0) * share[:, None], self.begins)
        return mean

    def any(self, flag: Bool) -> Bool:
        """(U,) whether a flag (P,) is that of one of the few at least."""
        some: Bool = np.logical_or.reduceat(flag[self.few], self.begins)
        return some


def _first(group: Int) -> Bool:
    """Whether each is the first of its group, given the groups side by side."""
    first = np.empty(len(group), np.bool_)
    first[:1] = True
    np.not_equal(group[1:], group[:-1], out=first[1:])
    return first


def united_proposals(proposals: Proposals, unions: Unions, yaw: Float64) -> Proposals:
    """The proposals with unions as if hidden in part; their boxes are about those of what they consist of.

    Their coordinates are not copied, since what comes after the tracker has no use for them.

    Args:
        proposals: (P,) as they were.
        unions: of them.
        yaw: (U,) headings of their boxes [rad].
    """
    offsets = np.zeros(len(unions.kept) + 1, np.int64)
    np.add.reduceat(proposals.count[unions.order], unions.starts).cumsum(out=offsets[1:])
    box, centroid = proposals.box.take(unions.kept, axis=0), proposals.centroid.take(unions.kept, axis=0)
    box[unions.new] = boxes_about(proposals.box.take(unions.few, axis=0), unions.union, yaw)
    share = unions.share(proposals.count)
    centroid[unions.new] = unions.mean(proposals.centroid, share)
    truncated, occluded = proposals.truncated[unions.kept], proposals.occluded[unions.kept]
    truncated[unions.new], occluded[unions.new] = unions.any(proposals.truncated), True
    return Proposals(
        members=np.concatenate([proposals.members[run] for run in unions.stretches(proposals.offsets)]),
        offsets=offsets,
        coordinates=proposals.coordinates[:, :0],
        centroid=centroid,
        box=box,
        truncated=truncated,
        occluded=occluded,
        sensor_height_m=proposals.sensor_height_m,
        reflectance=_brightness(proposals.reflectance, unions, share),
    )


def _brightness(reflectance: Float64 | None, unions: Unions, share: Float64) -> Float64 | None:
    """(Q, 5) that of all: the moments of unions follow from those of their parts; unknown where one's is."""
    if reflectance is None:
        return None
    told, squared = unions.mean(reflectance, share), np.square(reflectance)
    square = unions.mean(squared[:, :1] + squared[:, 1:2], share)[:, 0]
    told[:, 1] = np.sqrt(np.maximum(square - np.square(told[:, 0]), 0.0))
    told[:, 2] = np.maximum.reduceat(reflectance[unions.few, 2], unions.begins)
    every = reflectance.take(unions.kept, axis=0)
    every[unions.new] = told
    return every


def united_sightings(
    observations: Observations, unions: Unions, proposals: Proposals, T_world_sensor: Float64
) -> Observations:
    """The same in the world.

    Args:
        observations: (P,) as they were.
        unions: of them.
        proposals: (Q,) with unions.
        T_world_sensor: (4, 4) pose of the frame.
    """
    new, begins = unions.new, unions.begins
    united, kdop = observations.take(unions.kept), observations.kdop.take(unions.few, axis=1)
    centroid = unions.mean(observations.centroid, unions.share(observations.count))
    moved = centroid - transform(T_world_sensor, proposals.centroid.take(new, axis=0))[:, :2]
    box = transform_boxes(T_world_sensor, proposals.box.take(new, axis=0))
    box[:, :2] += moved
    united.box[new], united.centroid[new] = box, centroid
    united.kdop[:, new] = np.maximum.reduceat(kdop, begins, axis=1)
    united.bottom[new], united.top[new] = box[:, 2] - box[:, 5] / 2, box[:, 2] + box[:, 5] / 2
    united.count[new], united.partial[new] = np.add.reduceat(observations.count[unions.few], begins), True
    united.range_m[new] = np.hypot(*proposals.centroid[new, :2].T)
    return united


def united_matches(matches: Matches, unions: Unions) -> Matches:
    """The matches of what goes on: who had a part has nothing."""
    number = np.full(len(unions.order), NONE)
    number[unions.kept] = np.arange(len(unions.kept))
    own = number[matches.proposals]
    kept = (own != NONE).nonzero()[0]
    return Matches(
        matches.rows[kept],
        own[kept],
        matches.position.take(kept, axis=0),
        matches.covariance.take(kept, axis=0),
        matches.end_variance.take(kept, axis=0),
    )
