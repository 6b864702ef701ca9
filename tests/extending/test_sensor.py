"""How to add a sensor (docs/extending.md): a profile, a row of the simulated sensors, a driver of its packets."""

import shutil
import socket
from pathlib import Path

import numpy as np
import pytest

import modt
from modt import profile
from modt.errors import MisuseError
from modt.schemes import open_sensor
from modt.sources import drivers
from modt.sources.recognise import open_stream
from modt_simulation import sensors
from modt_simulation.synthetic_stream import SyntheticStream
from tests.extending import acme
from tools.send.pcap_writer import write_capture

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


@pytest.mark.slow
def test_a_simulated_drive_of_the_sensor_runs_with_its_profile(stream, tmp_path):
    path = tmp_path / "my-lidar.yaml"
    path.write_text(PROFILE)
    pipeline = modt.Pipeline.from_profile(path)
    for frame in stream:
        found = pipeline.step(frame.points, frame.stamp_s, frame.T_world_sensor)
    assert pipeline.config == profile.load(str(path))
    assert len(found.objects()) > 0
    assert (found.age == 10).any()


SWEEP = np.tile(np.array([[5.0, 1.0, -1.0, 0.5]], np.float32), (30, 1))
PACKET = acme.MAGIC + SWEEP.tobytes()


@pytest.fixture(name="folder")
def a_folder_of_drivers_with_that_of_acme(tmp_path, monkeypatch):
    shutil.copy(Path(acme.__file__), tmp_path)
    monkeypatch.setattr(drivers, "__path__", [*drivers.__path__, str(tmp_path)])
    return tmp_path


def test_a_file_makes_the_captures_of_a_maker_readable(folder):
    write_capture(folder / "a.pcap", [(1.0, b"of another"), (1.0, PACKET), (1.1, PACKET)], acme.DRIVER.port)
    stream = open_stream(folder / "a.pcap", capture={"scale": "2"})
    assert stream.info.layout == "Acme packets"
    assert [frame.points.tobytes() for frame in stream] == 2 * [(SWEEP / np.float32([1, 1, 1, 2])).tobytes()]


def test_a_file_makes_the_addresses_of_a_maker_known(folder, port):
    with pytest.raises(MisuseError, match=r"acme://\[HOST\]"):
        open_sensor("unknown://")
    live = open_sensor(f"acme://127.0.0.1:{port}")
    live.start()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sensor:
        sensor.sendto(PACKET, ("127.0.0.1", port))
    received = live.take(10.0)
    live.close()
    assert received.frame.points.tobytes() == SWEEP.tobytes()
