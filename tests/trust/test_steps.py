"""Steps of the ground, and parts of the view that end, in sweeps that are made for them."""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np

from modt.geometry import rotation_zyx
from modt.profile import load
from modt.trust.ground import GroundCheck
from modt.trust.returns import BANDS, ReturnsCheck
from modt.trust.sample import SECTORS, sample
from modt.trust.tuning import GroundTuning, ReturnsTuning
from modt.types import Frame

SENSOR = load("vlp-16").sensor
BACK_LOOKS = 3


class Ground:
    """A check of the ground that sees a level floor at given heights below the sensor, a look each 0.6 s."""

    def __init__(self):
        self.check = GroundCheck(GroundTuning(), 1.0)
        self.before = self.floor(0.0, 1.0)

    def floor(self, time_s, height_m):
        rng = np.random.default_rng(0)
        xy = rng.uniform(-6, 6, (2000, 2))
        points = np.column_stack([xy, np.full(2000, -height_m), np.zeros(2000)]).astype(np.float32)
        return sample(Frame(0, time_s, points), np.eye(4), SENSOR, self.check.present)

    def look(self, height_m):
        """The phrase after a look at the floor, which it reaches from one sweep to the next."""
        now = self.floor(self.before.time_s + 0.6, height_m)
        moved = self.check.has_moved(self.before, now)
        self.check.look(now, [(self.before, now, now)] if moved else [], BACK_LOOKS)
        if not self.check.phrase:
            self.check.learn(now)
        self.before = now
        return self.check.phrase


def test_a_step_that_was_taken_for_back_is_no_new_one_when_it_is_undone():
    ground = Ground()
    assert not any(ground.look(1.0) for _ in range(8))
    assert ground.look(0.6)
    slope = [ground.look(height_m) for height_m in (0.68, 0.76, 0.84, 0.92, 1.0, 1.0, 1.0, 1.0)]
    assert slope[0]
    assert not slope[-1]  # the floor there looks like the one before the step
    assert not ground.look(1.4)
    assert ground.check.undone
    assert ground.look(1.0)
    assert not ground.check.undone


def test_a_step_other_than_the_one_that_was_taken_for_back_is_reported():
    ground = Ground()
    for height_m in (*[1.0] * 8, 0.6, 0.68, 0.76, 0.84, 0.92, 1.0, 1.0, 1.0, 1.0):
        phrase = ground.look(height_m)
    assert not phrase
    assert ground.look(0.6)


def among_walls(time_s, pitch_deg, plane):
    """The level sweep of a pitched sensor 0.5 m above a floor amid walls; its lowest beam points 7 deg down."""
    elevation, bearing = np.meshgrid(np.deg2rad(np.linspace(-7, 30, 60)), np.linspace(-np.pi, np.pi, 400))
    ray = np.stack([np.cos(elevation) * np.cos(bearing), np.cos(elevation) * np.sin(bearing), np.sin(elevation)])
    R_level_sensor = rotation_zyx(0.0, np.deg2rad(pitch_deg), 0.0)
    x, y, z = R_level_sensor @ ray.reshape(3, -1)
    to_floor_m = np.where(z < 0, -0.5 / np.minimum(z, -1e-9), np.inf)
    to_wall_m = 5.0 / np.maximum(np.abs(x), np.abs(y))
    points = (np.minimum(to_floor_m, to_wall_m) * np.stack([x, y, z])).T.astype(np.float32)
    frame = Frame(0, time_s, points, R_level_sensor=R_level_sensor)
    return sample(frame, np.eye(4), SENSOR, plane)


def test_the_lowest_returns_of_a_swaying_sensor_are_no_ground_where_all_beams_are_above_it():
    plane = np.array([-0.5, 0.0, 0.0])
    sweeps = [among_walls(0.1 * k, pitch_deg, plane) for k, pitch_deg in enumerate((6.0, -6.0, 6.0))]
    assert all(0.1 < sweep.below_view.mean() < 0.5 for sweep in sweeps)
    check = GroundCheck(GroundTuning(), 0.5)
    for _ in range(8):
        check.learn(sweeps[0])
    assert check.known
    check.look(sweeps[-1], [(sweeps[0], sweeps[1], sweeps[2])], BACK_LOOKS)
    assert not check.phrase


class Counted(ReturnsCheck):
    """A check of returns whose sweeps are their counts."""

    def _count(self, sample):
        return sample.count


def view(of_sector):
    """A sweep with some returns in each sector, half of them in each of two bands."""
    count = np.zeros((SECTORS, BANDS))
    count[:, :2] = np.asarray(of_sector)[:, None] / 2
    return SimpleNamespace(count=count, weight=1.0)


def losses(*views):
    """Losses of some sweeps in a row, the first of which is usual."""
    check = Counted(ReturnsTuning())
    check._span = (0.0, 1.0)
    check._usual = views[0].count
    return [check._lost_sectors([a, b], 8.0) for a, b in pairwise(views)]


def test_half_a_view_that_ends_slowly_leaves_no_lost_part_when_some_of_it_is_back():
    half = np.arange(SECTORS) < SECTORS // 2
    whole = view(np.full(SECTORS, 30.0))
    thin = view(np.where(half, 8.0, 30.0))
    ended = view(np.where(half, 0.0, 30.0))
    partly = view(np.where(np.arange(SECTORS) < SECTORS // 4, 0.0, 30.0))
    slowly = losses(whole, thin, ended, partly)
    assert [loss and loss.blind for loss in slowly] == [None, True, None]
    at_once = losses(whole, ended, partly)
    assert [loss and loss.blind for loss in at_once] == [True, False]
