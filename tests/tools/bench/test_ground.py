"""The benchmark of the ground."""

import numpy as np

from tools.bench import ground

ROAD = 40
CAR = 10


def scan():
    label = np.array([ROAD, ROAD, CAR, ground.VEGETATION, ground.VEGETATION, 0, 1])
    points = np.zeros((len(label), 4), np.float32)
    points[:, 0] = 10.0
    points[:, 2] = [-1.7, -1.7, -1.0, -1.6, 0.0, -1.7, -1.7]
    return ground.LabelledScan(points, label)


def test_vegetation_does_not_count_or_counts_as_ground_near_the_ground():
    road, car = scan().truth(vegetation=False)
    assert road.tolist() == [True, True, False, False, False, False, False]
    assert car.tolist() == [False, False, True, False, False, False, False]
    low, high = scan().truth(vegetation=True)
    assert low.tolist() == [True, True, False, True, False, False, False]
    assert high.tolist() == [False, False, True, False, True, False, False]


def test_precision_counts_labelled_points_alone():
    road, car = scan().truth(vegetation=False)
    found = np.array([True, False, True, True, True, True, True])
    score = ground.Score.of(found, road, car)
    assert (score.precision, score.recall) == (50.0, 50.0)
    assert score.cells() == "50.00 | 50.00 | 50.00"
    assert len(list(ground.rows({"all": found}, [scan()], ground.RANGES_M))) == 2
