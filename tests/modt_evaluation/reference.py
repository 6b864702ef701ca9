"""The definitions written once more, in plain loops, for whole runs; boxes upright in the sensor's frame."""

from __future__ import annotations

from collections import Counter, defaultdict
from itertools import pairwise

import numpy as np

from modt.classes import CLASS_NAMES
from modt_evaluation.overlap import inside

NAMED = {"Car": 1, "Van": 1, "Pedestrian": 2, "Person_sitting": 2, "Cyclist": 3}


def shares(frame):
    """Type, identity and number of points of each object, and how many of them each proposal holds."""
    for name, id_, box in zip(frame.truth.type_, frame.truth.id.tolist(), frame.truth.box, strict=True):
        own = inside(frame.points, box)
        yield name, id_, int(own.sum()), Counter(frame.proposal[own & (frame.proposal >= 0)].tolist())


def recall(frames):
    """Found and all objects of 20 points or more, by type."""
    hit = Counter()
    total = Counter()
    for frame in frames:
        size = Counter(frame.proposal.tolist())
        for name, _, n, shared in shares(frame):
            if n >= 20:
                best, most = shared.most_common(1)[0] if shared else (None, 0)
                total[name] += 1
                hit[name] += most > 0.5 * (size[best] + n - most)
    return {name: (hit[name] / total[name], total[name]) for name in total}


def life(frames):
    """Life as seen, labelled frames of 10 points or more, discontinuities, mis-associations."""
    seen = defaultdict(list)
    owned = defaultdict(Counter)
    labelled = 0
    for frame in frames:
        track = dict(zip(frame.of_track.tolist(), frame.track.tolist(), strict=True))
        for _, id_, n, shared in shares(frame):
            labelled += n >= 10
            best = max(sorted(shared), key=lambda k: shared[k], default=None)
            if n >= 10 and best in track:
                seen[id_].append(track[best])
                owned[track[best]][id_] += 1
    breaks = sum(a != b for v in seen.values() for a, b in pairwise(v))
    mixed = sum(sum(n >= 3 for n in o.values()) > 1 for o in owned.values())
    return sum(map(len, seen.values())) / (breaks + len(seen)), labelled, breaks, mixed


def precision_of_ranking(frames):
    """Average precision by class; nothing is ignored but what lies beyond 40 degrees of x, and parked cars."""
    rows = []
    positives = Counter()
    for frame in frames:
        label = {}
        for name, _, n, shared in shares(frame):
            if n >= 10 and name in NAMED:
                positives[NAMED[name]] += 1
                for k, most in shared.items():
                    if most > 0.5 * (frame.proposal == k).sum() and most > 0.5 * n:
                        label[k] = NAMED[name]
        parked = [inside(frame.points, box, 0.4) for box in frame.truth.parked]
        ahead = np.abs(np.arctan2(frame.points[:, 1], frame.points[:, 0])) < np.deg2rad(40)
        for k, posterior in zip(frame.of_track.tolist(), frame.posterior, strict=True):
            own = frame.proposal == k
            excused = k not in label and any(hidden[own].mean() > 0.5 for hidden in parked)
            if ahead[own].mean() > 0.5 and not excused:
                rows.append((posterior, label.get(k, 0)))
    out = {}
    for c, name in enumerate(CLASS_NAMES[1:], 1):
        ranked = [label == c for posterior, label in sorted(rows, key=lambda row: -row[0][c])]
        precision = np.cumsum(ranked) / np.arange(1, len(ranked) + 1)
        best = np.maximum.accumulate(precision[::-1])[::-1]
        out[name] = (float(best[ranked].sum() / max(positives[c], 1)), positives[c])
    return out
