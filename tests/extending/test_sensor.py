"""How to add a sensor (docs/extending.md): a profile, and a row of the simulated sensors."""

import numpy as np
import pytest

import modt
from modt import profile
from modt_simulation import sensors
from modt_simulation.synthetic_stream import SyntheticStream

PROFILE = """
sensor:
  height_m: 1.2
  min_range_m: 0.5
  max_range_m: 60.0
  elevation_step_deg: 1.25
  azimuth_step_deg: 0.3
segmentation:
  cell_m: 0.15
"""


@pytest.fixture(name="stream")
def a_stream_of_the_sensor(monkeypatch):
    model = sensors.SensorModel(
        name="my-lidar",
        elevation_rad=np.deg2rad(np.linspace(10.0, -30.0, 32)),
        azimuth_rad=np.linspace(0.0, 2 * np.pi, 1200, endpoint=False),
        height_m=1.2,
        min_range_m=0.5,
        max_range_m=60.0,
    )
    monkeypatch.setitem(sensors.SENSORS, model.name, model)
    return SyntheticStream("street", "my-lidar", 1.0, seed=0)


def test_a_simulated_drive_of_the_sensor_runs_with_its_profile(stream, tmp_path):
    path = tmp_path / "my-lidar.yaml"
    path.write_text(PROFILE)
    pipeline = modt.Pipeline.from_profile(path)
    for frame in stream:
        found = pipeline.step(frame.points, frame.stamp_s, frame.T_world_sensor)
    assert pipeline.config == profile.load(str(path))
    assert len(found.objects()) > 0
    assert (found.age == 10).any()
