"""The tables that stages share."""

import dataclasses

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from modt.types import NONE, Tracks
from modt_evaluation.experiments.segmented import chosen
from tests.results import proposals


@given(st.lists(st.integers(1, 9), max_size=6))
def test_labels_and_counts_agree(counts):
    found = proposals(counts)
    n = sum(counts) + 3
    label = found.label(n)
    assert found.count.tolist() == counts
    assert np.bincount(label + 1, minlength=len(counts) + 1).tolist() == [3, *counts]


@given(st.lists(st.integers(1, 9), min_size=1, max_size=6), st.data())
def test_some_of_the_proposals(counts, data):
    found = proposals(counts)
    which = data.draw(st.lists(st.sampled_from(range(len(counts))), min_size=1, unique=True))
    some = chosen(found, np.array(which))
    assert some.count.tolist() == [counts[k] for k in which]
    for i, k in enumerate(which):
        own, those = (slice(*p.offsets[n : n + 2]) for p, n in ((some, i), (found, k)))
        assert some.members[own].tolist() == found.members[those].tolist()
        assert_array_equal(some.coordinates[:, own], found.coordinates[:, those])
    assert_array_equal(some.box, found.box[which])


@given(st.lists(st.booleans(), max_size=6), st.integers(0, 5))
def test_tracks_are_renewed_in_every_column(kept, n):
    tracks = Tracks.blank(len(kept))
    for column in tracks.columns().values():
        column[:] = np.arange(1, len(kept) + 1).reshape(-1, *[1] * (column.ndim - 1))
    rows = np.flatnonzero(kept)
    renewed = tracks.renewed(rows, n)
    for name, blank in Tracks.blank(n).columns().items():
        assert_array_equal(getattr(renewed, name), np.concatenate([getattr(tracks, name)[rows], blank]))
    assert (renewed.id[len(rows) :] == NONE).all()
    assert renewed.columns().keys() == {f.name for f in dataclasses.fields(Tracks)}
