"""Findings of fuzzing: inputs that once made a reader fail by another error than ours."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path

import numpy as np
import pytest

from modt import profile
from modt.classification.pointnet import read_model
from modt.cli.status import read as read_status
from modt.errors import ModtError
from modt.ros2.cdr import CdrWriter
from modt.sources.packets.hesai import read_angles
from modt.sources.packets.ouster import OusterDecoder
from modt.sources.packets.velodyne import VelodyneDecoder
from modt.sources.pose_source import read_poses
from modt.sources.recognise import open_stream
from modt.sources.scan_file import read_scan
from modt_desk.reporting.records import read_records
from tests.desk.reporting.test_run_report import ledger_line
from tests.fuzz.execution import limits
from tests.fuzz.runs import DESCRIPTION, SENSOR_BOMB, network
from tests.fuzz.targets import TARGETS
from tests.sources import bags
from tests.sources.layouts import CAMERA

R, T = f"R: {CAMERA['R']}", "T: 0 0 0"
CALIBRATION = f"R_rect_00: {CAMERA['R']}\nP_rect_02: {CAMERA['P']}\n"
CUBOID = "frame,track,label,x,y,z,l,w,h,yaw\n0,{id},Car,9,1,0.5,2,1,1.5,{yaw}\n"
LABEL = "Car 0 0 -1.5 0 0 9 9 1.5 {width} 4.0 1.0 1.7 10.0 -1.5708\n"
MODEL = network().SerializeToString()
MAGIC = b"\x89MCAP0\r\n"
HUGE = 10**30


def odometry() -> bytes:
    cdr = CdrWriter()
    cdr.header(1.5, "odom")
    cdr.text("base_link")
    cdr.record(("7d",), 0, 0, 0, 1e300, 0, 0, 1e300)
    return cdr.message()


def chunk_of(size: int, folder: Path) -> bytes:
    """A recording that was not closed, with the size of its first chunk when unpacked."""
    whole = bytearray(bags.write_mcap(folder / "a", bags.clouds(2)).read_bytes())
    begin = len(MAGIC) + 9 + int.from_bytes(whole[len(MAGIC) + 1 : len(MAGIC) + 9], "little")
    whole[begin + 25 : begin + 33] = size.to_bytes(8, "little")
    return bytes(whole[: begin + 9 + int.from_bytes(whole[begin + 1 : begin + 9], "little")])


FOUND = {
    "a calibration that is not finite": ("calibration_of_sequence", f"P2: {CAMERA['P']}\nTr: {'inf ' * 12}"),
    "a size of one number": ("calibration_of_drive", f"S_rect_02: 9\n{CALIBRATION}---{R}\n{T}---{R}\n{T}"),
    "a rotation that is not finite": ("calibration_of_drive", f"{CALIBRATION}---{'R: ' + 'inf ' * 9}\n{T}---{R}"),
    "a place beyond the pole": ("oxts_records", "95 8.4 110 0 0 0"),
    "a label that is not finite": ("labels_of_frame", LABEL.format(width="inf")),
    "a frame that no drive reaches": ("truth_of_sequence", f"{HUGE} 4 {LABEL.format(width=2)}"),
    "an identity of 100 bits": ("cuboids", CUBOID.format(id=HUGE, yaw=0.1)),
    "a cuboid that is not finite": ("cuboids", CUBOID.format(id=3, yaw="nan")),
    "a detection in a frame that no drive reaches": (
        "detections",
        f"{HUGE},2,{'1,' * 12}1",
    ),
    "a record of 3 GiB": ("mcap", MAGIC + b"\x01" + (3 * 2**30).to_bytes(8, "little") + bytes(100)),
    "a quaternion beyond the square root": ("odometry", odometry()),
    "a value of aliases": ("profiles", SENSOR_BOMB),
    "a nested profile": ("profiles", "[" * 5000),
    "a profile of a megabyte": ("profiles", "# " + "x" * 2**20),
    "a name in a model that is no text": (
        "models",
        network().SerializeToString().replace(b"points", b"p\xff\xfents"),
    ),
    "a nested description of a run": ("run_description", "[" * 5000),
    "a run without its mode": ("run_description", "schema: modt.run/1\nprofile: {}\n"),
    "a run with a profile of text": ("run_description", "schema: modt.run/1\nprofile: {classification: {batch: x}}"),
    "a line without its stages": ("ledger", json.dumps({**ledger_line(0, 0), "stages": None}) + "\n"),
    "a frame whose squares overflow": (
        "ledger",
        json.dumps(ledger_line(0, 3)).replace('"points": 120', '"points": 1e200') + "\n",
    ),
    "a number of 5,000 digits": ("ledger", "9" * 5000 + "\n"),
    "nested lines": ("ledger", "[" * 5000 + "\n"),
    "a frame without its tracks": ("tracks", '{"schema": "modt.frame/3"}\n'),
    "a status without its loop": ("service_status", '{"schema": "modt.status/1"}'),
    "a nested prediction": ("predictions", "[" * 5000),
    "a nested calibration": ("calibrations", "[" * 5000),
    "a run of infinite proposals": (
        "judged_run",
        f"{DESCRIPTION}---\n"
        '{"schema": "modt.frame/3", "frame": 1, "proposals": 1e999, "classifications": 1, "tracks": []}\n',
    ),
    "a run whose costs have no frame": (
        "viewed_run",
        '{"schema": "modt.ledger/1"}\n---\n{"schema": "modt.frame/3"}\n',
    ),
    "a nested status": ("service_status", "[" * 5000),
}


@pytest.mark.parametrize(("target", "raw"), FOUND.values(), ids=FOUND)
def test_it_is_refused(target: str, raw: bytes | str, tmp_path: Path) -> None:
    _, call = TARGETS[target].prepare(tmp_path)
    content = raw.encode() if isinstance(raw, str) else raw
    with limits(), pytest.raises(TARGETS[target].refusals):
        call(content)


def test_infinities_of_either_sign_are_no_return(tmp_path: Path) -> None:
    path = tmp_path / "a.bin"
    path.write_bytes(np.array([np.inf, -np.inf, 0, 0], np.float32).tobytes())
    assert read_scan(path)[0].tolist() == [[0, 0, 0, 0]]


def test_a_database_whose_schema_is_no_text_is_refused(tmp_path: Path) -> None:
    (seed,), call = TARGETS["database"].prepare(tmp_path)
    with limits(), pytest.raises(ModtError, match="cannot be read"):
        call(seed.replace(b"NOT NULL", b"NOT NU\xbc\xb3"))


def test_a_message_of_a_channel_that_is_not_listed_is_refused(tmp_path: Path) -> None:
    (seed, _), call = TARGETS["mcap"].prepare(tmp_path)
    whole = bytearray(seed)
    channel = whole.rindex(b"\x04", 0, whole.rindex(b"/odom"))  # its record in the summary
    whole[channel + 9] ^= 0xFF
    with limits(), pytest.raises(ModtError, match="cannot be read"):
        call(bytes(whole))


def test_packets_that_do_not_make_a_frame_are_refused(tmp_path: Path) -> None:
    (seed,), call = TARGETS["ouster_metadata"].prepare(tmp_path)
    with limits(), pytest.raises(ModtError, match="512 columns in packets of 15"):
        call(seed.replace(b'"columns_per_packet":16', b'"columns_per_packet":15'))


def test_a_format_of_packets_that_is_not_named_is_refused(tmp_path: Path) -> None:
    (seed,), call = TARGETS["ouster_metadata"].prepare(tmp_path)
    told = re.sub(rb'"config_params":{[^}]*}', b'"config_params":{}', seed).replace(b'"udp_profile_lidar"', b'"x"')
    with limits(), pytest.raises(ModtError, match="no metadata of an Ouster"):
        call(told)


@pytest.mark.parametrize(
    "instead", [(b'"age": 1', b'"age": 1e999'), (b'"proposals": 1', b'"proposals": 1000000000000')]
)
def test_a_record_of_impossible_numbers_is_refused(instead: tuple[bytes, bytes], tmp_path: Path) -> None:
    (seed,), call = TARGETS["exported_run"].prepare(tmp_path)
    call(seed)
    with limits(), pytest.raises(ModtError, match=r"tracks\.jsonl:1"):
        call(seed.replace(*instead))


@pytest.mark.parametrize(
    "instead", [(b'"classifications": 1', b'"classifications": []'), (b'"w": 1.5', b'"w": 1e308')]
)
def test_a_view_of_impossible_numbers_is_refused(instead: tuple[bytes, bytes], tmp_path: Path) -> None:
    (seed,), call = TARGETS["viewed_run"].prepare(tmp_path)
    with limits(), pytest.raises(ModtError, match=r"tracks\.jsonl"):
        call(seed.replace(*instead))


def test_a_weight_of_400_digits_is_refused(tmp_path: Path) -> None:
    (seed,), call = TARGETS["model_metadata"].prepare(tmp_path)
    with limits(), pytest.raises(ModtError, match="malformed box or reflectance classifier"):
        call(seed.replace(b"0.1", b"1" + b"0" * 400, 1))


@pytest.mark.parametrize("without", [b'"asked"', b'"accurate"', b'"gamma"', b'"value"'])
def test_a_prediction_that_lacks_something_is_refused(without: bytes, tmp_path: Path) -> None:
    (seed,), call = TARGETS["predictions"].prepare(tmp_path)
    call(seed)
    with limits(), pytest.raises(ModtError, match=r"blind\.json: holds a record that modt did not write"):
        call(seed.replace(without, b'"x"'))


@pytest.mark.parametrize(
    ("instead", "said"),
    [
        ((b'"accurate"', b'"exact"'), "of the modes"),
        ((b'"asked_1"', b'"x"'), "asked_1"),
        ((b'"segmentation": [', b'"segmentation": [-'), "negative"),
    ],
)
def test_a_calibration_of_other_modes_or_numbers_is_refused(
    instead: tuple[bytes, bytes], said: str, tmp_path: Path
) -> None:
    (seed,), call = TARGETS["calibrations"].prepare(tmp_path)
    call(seed)
    with limits(), pytest.raises(ModtError, match=said):
        call(seed.replace(*instead))


def test_a_chunk_of_2_to_the_63_bytes_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "cut.mcap"
    path.write_bytes(chunk_of(2**63, tmp_path))
    with limits(), pytest.raises(ModtError, match="holds no message"):
        open_stream(path)


PIPES = {
    "poses": read_poses,
    "records": lambda path: list(read_records(path, "modt.frame/3")),
    "status": lambda path: read_status(path.parent),
    "calibration of a Velodyne": lambda path: VelodyneDecoder("sensor", calibration=path),
    "calibration of a Hesai": read_angles,
    "metadata of an Ouster": lambda path: OusterDecoder("sensor", path),
    "model": read_model,
    "profile": lambda path: profile.load([str(path)]),
}


@pytest.mark.parametrize("read", PIPES)
def test_a_pipe_in_the_place_of_a_file_is_refused_at_once(read, tmp_path):
    path = tmp_path / "status.json"
    os.mkfifo(path)
    if "Velodyne" in read or "Ouster" in read:
        pytest.importorskip("velodyne_decoder" if "Velodyne" in read else "ouster.sdk")
    with pytest.raises(ModtError, match=r"no (such )?file"):
        PIPES[read](path)
