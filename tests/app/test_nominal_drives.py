"""Whole drives without a fault, by exact poses: every frame is trusted, and the poses are believed."""

import numpy as np
import pytest

from modt.app.inputs import Request
from modt.app.stages import Stages
from modt.energy.ledger import Ledger
from modt.types import TrustLevel
from modt_simulation import scenery
from modt_simulation.builder import SceneBuilder
from modt_simulation.materials import Material
from modt_simulation.motion import Path
from modt_simulation.synthetic_stream import SCENES, SyntheticStream
from modt_simulation.yard import enclose, floor

SENSOR = "vlp-16"
SECONDS = 6.0
SPEED_MPS = 1.1
HALF_M = (31.0, 31.0)
"""Half the sides of a square, whose walls are met by few beams: the parts that a beam meets follow the robot."""
THINGS = 6


def far_walls(rng, seconds, height_m):
    """A robot among few things that rest, within far walls."""
    builder = SceneBuilder(rng, seconds)
    enclose(builder, HALF_M, 3.0)
    makers = (scenery.tree, scenery.pole, scenery.bin_)
    for k in range(THINGS):
        distance_m = rng.uniform(10.0, 26.0)
        bearing = rng.uniform(-np.pi, np.pi)
        thing = makers[k % len(makers)](rng)
        builder.scenery(thing, distance_m * np.cos(bearing), distance_m * np.sin(bearing))
    way = [(-HALF_M[0], 0.0), (HALF_M[0], 0.0)]
    start_m = HALF_M[0] - SPEED_MPS * seconds / 2
    ego = Path.steady(way, start_m, SPEED_MPS, seconds)
    return builder.world(floor(rng, HALF_M, Material.ASPHALT, 0.01), ego, height_m)


@pytest.mark.parametrize("scene", [far_walls, "street"], ids=["far walls", "street"])
def test_exact_poses_are_believed_and_every_frame_is_trusted(scene, monkeypatch):
    if callable(scene):
        monkeypatch.setitem(SCENES, "far walls", scene)
        scene = "far walls"
    stream = SyntheticStream(scene, SENSOR, SECONDS, 1)
    stages = Stages(Request(profile=[SENSOR], odometry="recording"), stream.info, Ledger(), live=True)
    for frame in stream:
        if frame.index == 0:
            stages.choose_profile(frame)
        result = stages.step(frame, stages.budget, reduced=False)
        stages.ledger.close_frame(frame.index)
        assert result.trust.level is TrustLevel.GOOD
        assert np.allclose(result.T_world_sensor[:2, 3], frame.T_world_sensor[:2, 3], atol=1e-6)
