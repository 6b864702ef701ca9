"""Findings of fuzzing: inputs that once made a reader fail by another error than ours."""

import json
import os
import re

import pytest

from modt import profile
from modt.cli.status import read as read_status
from modt.errors import ModtError
from modt.model_file import ModelFile
from modt.ros2.cdr import CdrWriter
from modt.sources.drivers.hesai import read_angles
from modt.sources.drivers.ouster import OusterDecoder
from modt.sources.drivers.velodyne import VelodyneDecoder
from modt.sources.pose_file import read_poses
from modt_profiling.reporting.records import read_records
from tests.fuzz.execution import limits
from tests.fuzz.runs import SENSOR_BOMB, network
from tests.fuzz.targets import TARGETS
from tests.modt_profiling.reporting.test_run_report import ledger_line
from tests.sources.layouts import CAMERA

R = f"R: {CAMERA['R']}"
T = "T: 0 0 0"
MODEL = network().SerializeToString()
CALIBRATION = f"R_rect_00: {CAMERA['R']}\nP_rect_02: {CAMERA['P']}\n"


def odometry():
    cdr = CdrWriter()
    cdr.header(1.5, "odom")
    cdr.text("base_link")
    cdr.record(("7d",), 0, 0, 0, 1e300, 0, 0, 1e300)
    return cdr.message()


FOUND = {
    "a size of one number": ("calibration_of_drive", f"S_rect_02: 9\n{CALIBRATION}---{R}\n{T}---{R}\n{T}"),
    "a rotation that is not finite": ("calibration_of_drive", f"{CALIBRATION}---{'R: ' + 'inf ' * 9}\n{T}---{R}"),
    "a place beyond the pole": ("oxts_records", "95 8.4 110 0 0 0"),
    "a detection in a frame that no drive reaches": ("detections", f"{10**30},2,{'1,' * 12}1"),
    "a record of 3 GiB": ("mcap", b"\x89MCAP0\r\n\x01" + (3 * 2**30).to_bytes(8, "little") + bytes(100)),
    "a quaternion beyond the square root": ("odometry", odometry()),
    "a value of aliases": ("profiles", SENSOR_BOMB),
    "a profile of a megabyte": ("profiles", "# " + "x" * 2**20),
    "a name in a model that is no text": ("models", MODEL.replace(b"points", b"p\xff\xfents")),
    "a nested description of a run": ("run_description", "[" * 5000),
    "a run without its mode": ("run_description", "schema: modt.run/1\nprofile: {}\n"),
    "a run with a profile of text": ("run_description", "schema: modt.run/1\nprofile: {classification: {batch: x}}"),
    "a line without its stages": ("ledger", json.dumps({**ledger_line(0, 0), "stages": None}) + "\n"),
    "a number of 5,000 digits": ("ledger", "9" * 5000 + "\n"),
    "a frame without its tracks": ("tracks", '{"schema": "modt.frame/4"}\n'),
    "a status without its loop": ("service_status", '{"schema": "modt.status/1"}'),
    "costs without a frame": ("viewed_run", '{"schema": "modt.ledger/1"}\n---\n{"schema": "modt.frame/4"}\n'),
}


@pytest.mark.parametrize(("target", "raw"), FOUND.values(), ids=FOUND)
def test_a_finding_is_refused(target, raw, tmp_path):
    _, call = TARGETS[target].prepare(tmp_path)
    with limits(), pytest.raises(TARGETS[target].refusals):
        call(raw.encode() if isinstance(raw, str) else raw)


EDITED = [  # target, what is replaced in its first seed, by what, and the cause that is named
    ("database", b"NOT NULL", b"NOT NU\xbc\xb3", "cannot be read"),
    ("ledger", b'"points": 120', b'"points": 1e200', "modt did not write"),
    ("ouster_metadata", b'"columns_per_packet":16', b'"columns_per_packet":15', "512 columns in packets of 15"),
    ("ouster_metadata", b'"udp_profile_lidar"', b'"x"', "no metadata of an Ouster"),
    ("exported_run", b'"age": 1', b'"age": 1e999', r"tracks\.jsonl:1"),
    ("exported_run", b'"proposals": 1', b'"proposals": 1000000000000', r"tracks\.jsonl:1"),
    ("viewed_run", b'"classifications": 1', b'"classifications": []', r"tracks\.jsonl"),
    ("viewed_run", b'"w": 1.5', b'"w": 1e308', r"tracks\.jsonl"),
    ("judged_run", b'"proposals": 1', b'"proposals": 1e999', r"tracks\.jsonl"),
    ("model_metadata", b"[[[[0.1,", b"[[[[1" + b"0" * 400 + b",", "malformed box or reflectance classifier"),
]


@pytest.mark.parametrize(("target", "old", "new", "cause"), EDITED, ids=[f"{e[0]}-{k}" for k, e in enumerate(EDITED)])
def test_a_valid_input_with_something_impossible_is_refused(target, old, new, cause, tmp_path):
    (seed, *_), call = TARGETS[target].prepare(tmp_path)
    if b"udp_profile" in old:
        seed = re.sub(rb'"config_params":{[^}]*}', b'"config_params":{}', seed)  # where it is named too
    call(seed)
    assert old in seed
    with limits(), pytest.raises(ModtError, match=cause):
        call(seed.replace(old, new))


PIPES = {
    "poses": read_poses,
    "records": lambda path: list(read_records(path, "modt.frame/4")),
    "status": lambda path: read_status(path.parent),
    "calibration of a Velodyne": lambda path: VelodyneDecoder("sensor", calibration=path),
    "calibration of a Hesai": read_angles,
    "metadata of an Ouster": lambda path: OusterDecoder("sensor", path),
    "model": ModelFile.read,
    "profile": lambda path: profile.load([str(path)]),
}


@pytest.mark.parametrize("read", PIPES)
def test_a_pipe_in_the_place_of_a_file_is_refused_at_once(read, tmp_path):
    path = tmp_path / "status.json"
    os.mkfifo(path)
    if "Ouster" in read:
        pytest.importorskip("ouster.sdk")
    with pytest.raises(ModtError, match=r"no (such )?file"):
        PIPES[read](path)
