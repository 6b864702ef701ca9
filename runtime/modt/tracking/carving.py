"""Proposals cut in pieces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modt.geometry import upright_box
from modt.types import Float64, Int, Proposals


def carved(proposals: Proposals, hosts: Int, pieces: list[Int], yaw: Float64) -> Proposals:
    """Proposals with pieces of some as further ones, of unknown reflectance and as if hidden in part.

    Args:
        proposals: (P,) as they were.
        hosts: (n,) out of which each piece is taken.
        pieces: n > 0 times members of the host, none of them twice and never all of a host's.
        yaw: (n,) headings of the pieces' boxes [rad]; their hosts' keep theirs.
    """
    cut = np.unique(hosts)
    left = np.ones(len(proposals.members), np.bool_)
    left[np.concatenate(pieces)] = False
    kept: list[slice | Int] = []  # whole stretches of what is left are copied faster than one by one
    end = 0
    for host in cut:
        begin, stop = proposals.offsets[host : host + 2]
        kept += [slice(end, begin), begin + np.flatnonzero(left[begin:stop])]
        end = stop
    order = [*kept, slice(end, None), *pieces]
    size = np.array([len(piece) for piece in pieces])
    count = np.append(proposals.count, size)
    np.subtract.at(count, hosts, size)
    offsets = np.append(0, np.cumsum(count))
    coordinates = np.concatenate([proposals.coordinates[:, rows] for rows in order], axis=1)
    n = len(proposals)
    source = np.append(np.arange(n), hosts)
    box, centroid = proposals.box.take(source, axis=0), proposals.centroid.take(source, axis=0)
    box[n:, 6] = yaw
    for k in [*cut, *range(n, n + len(hosts))]:
        xyz = coordinates[:, offsets[k] : offsets[k + 1]].astype(np.float64)
        box[k], centroid[k] = upright_box(xyz, box[k, 6]), xyz.mean(axis=1)
    occluded = proposals.occluded[source]
    occluded[n:] = True
    reflectance = proposals.reflectance
    if reflectance is not None:
        reflectance = np.concatenate([reflectance, np.full((len(hosts), reflectance.shape[1]), np.nan)])
    return replace(
        proposals,
        members=np.concatenate([proposals.members[rows] for rows in order]),
        offsets=offsets,
        coordinates=coordinates,
        centroid=centroid,
        box=box,
        truncated=proposals.truncated[source],
        occluded=occluded,
        reflectance=reflectance,
    )
