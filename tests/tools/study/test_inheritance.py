"""Inheritance from the background map."""

import numpy as np
import pytest

from modt.tracking.background_map import NoMemory
from tools.study.inheritance import Tally, table_of
from tools.study.truth_replay import replay


@pytest.mark.slow
def test_inheritance_is_counted_with_and_without_the_background_map(crossing):
    kind_of = np.array([int(body.kind.object_class) for body in crossing.simulator.world.bodies])
    on, off = Tally(), Tally()
    on.add(replay(crossing, "vlp-16"), kind_of)
    off.add(replay(crossing, "vlp-16", memory=NoMemory()), kind_of)
    assert on.proposals == off.proposals
    assert off.inherited == sum(off.wrong.values()) == len(off.frames_wrong) == 0
    assert 0 < on.inherited <= on.born
    assert on.calls < off.calls
    assert sum(on.wrong.values()) == len(on.frames_wrong) <= on.inherited
    assert all(n >= 1 for n in on.frames_wrong)
    assert table_of(on, off).count("\n") == 6
