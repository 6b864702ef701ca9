"""Truth of proposals."""

import numpy as np

from modt.types import NONE, Proposals
from tools.study.truth_replay import majority_bodies


def test_a_proposal_is_on_the_body_of_most_of_its_points():
    instance = np.array([3, 3, 7, NONE, NONE, 7, 7])
    none = np.zeros(3, np.bool_)
    members, offsets = np.arange(7), np.array([0, 3, 5, 7])
    nowhere = np.zeros((3, 7), np.float32)
    proposals = Proposals(members, offsets, nowhere, np.zeros((3, 3)), np.zeros((3, 7)), none)
    body, share = majority_bodies(proposals, instance)
    assert body.tolist() == [3, NONE, 7]
    np.testing.assert_allclose(share, [2 / 3, 1.0, 1.0])
    assert [len(a) for a in majority_bodies(Proposals.empty(), instance)] == [0, 0]
