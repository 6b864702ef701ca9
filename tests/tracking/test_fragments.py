"""The larger part of an object goes to its eldest track."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from modt.tracking.fragments import swap_proposals
from modt.types import NONE


def one_by_one(pairs, proposal, owner):
    """What each track has, and what is free, after swap upon swap; nobody and nothing changes hands twice."""
    proposal, owner, moved, changed = list(proposal), list(owner), set(), set()
    for elder, part in pairs:
        younger, left = owner[part], proposal[elder]
        if part in moved or elder in changed or younger in changed:
            continue
        proposal[elder], owner[part] = part, elder
        moved |= {part, left}
        changed.add(elder)
        if younger != NONE:
            proposal[younger] = left
            changed.add(younger)
        if left != NONE:
            owner[left] = younger
    return proposal, changed


@given(st.data(), st.integers(1, 6), st.integers(1, 6))
def test_each_proposal_has_one_track_whoever_wants_it(data, n_tracks, n_proposals):
    k = data.draw(st.integers(0, min(n_tracks, n_proposals)))
    rows = data.draw(st.permutations(range(n_tracks)))[:k]
    columns = data.draw(st.permutations(range(n_proposals)))[:k]
    proposal, owner = np.full(n_tracks, NONE), np.full(n_proposals, NONE)
    proposal[rows], owner[columns] = columns, rows
    pair = st.tuples(st.integers(0, n_tracks - 1), st.integers(0, n_proposals - 1))
    pairs = [(elder, part) for elder, part in data.draw(st.lists(pair, max_size=8)) if owner[part] != elder]
    elders, parts = np.array(pairs, np.int64).reshape(-1, 2).T
    changed, has = swap_proposals(elders, parts, proposal, owner)
    expected, who = one_by_one(pairs, proposal.tolist(), owner.tolist())
    assert changed.tolist() == sorted(who)
    after = proposal.copy()
    after[changed] = has
    assert after.tolist() == expected
    held = after[after != NONE]
    assert len(np.unique(held)) == len(held)
