import numpy as np
import pytest

from modt.geometry.beams import BeamTable, EvenBeams

UNEVEN_DEG = (2.0, 1.0, 0.5, 0.0, -0.5, -1.0, -2.0, -6.0, -12.0)


def tangent(*elevations_deg):
    return np.tan(np.deg2rad(elevations_deg)).astype(np.float32)


def test_even_beams_are_alike_everywhere():
    assert EvenBeams(0.5).step_rad(tangent(-20.0, 0.0)) == pytest.approx(np.deg2rad(0.5))


def test_the_spacing_is_that_of_the_wider_gap_at_the_nearest_beam_and_outside_the_view_the_outermost_one():
    at_deg, gap_deg = np.array([(0, 0.5), (0.2, 0.5), (1, 1), (-1.1, 1), (-2.1, 4), (-5, 6), (40, 1), (-80, 6)]).T
    assert np.rad2deg(BeamTable(UNEVEN_DEG).step_rad(tangent(*at_deg))) == pytest.approx(gap_deg, rel=1e-4)
