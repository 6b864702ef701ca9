"""Addresses lead to the opener of their scheme."""

import re
import sys

import pytest

from modt.address import Scheme
from modt.config import OdometryConfig
from modt.errors import MisuseError
from modt.schemes import POSES, SINKS, open_poses, open_sensor, open_sink


def parts(address, *arguments):
    return address.host, address.port, address.path, dict(address.options), *arguments


@pytest.mark.parametrize(
    ("table", "opened", "arguments"),
    [
        (SINKS, open_sink, []),
        (POSES, open_poses, [OdometryConfig()]),
    ],
    ids=["sink", "poses"],
)
def test_the_opener_of_the_scheme_has_the_address_and_what_goes_with_it(table, opened, arguments, monkeypatch):
    monkeypatch.setitem(table, "echo", Scheme("echo://", parts, frozenset({"a"})))
    assert opened("echo://here:7/there?a=b", *arguments) == ("here", 7, "/there", {"a": "b"}, *arguments)


def test_a_dash_is_standard_output(monkeypatch):
    monkeypatch.setitem(SINKS, "stdout", Scheme("stdout://", lambda address: address.scheme))
    assert open_sink("-") == "stdout"


def test_an_extra_that_is_missing_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "foxglove", None)
    monkeypatch.delitem(sys.modules, "modt.sinks.foxglove_sinks", raising=False)
    with pytest.raises(MisuseError, match=r"needs foxglove; pip install '\.\[foxglove\]'"):
        open_sink("foxglove://")


@pytest.mark.parametrize("text", ["nothing://here", "2368", "velodyne://here?colour=red"])
def test_what_is_no_address_of_a_sensor_is_refused(text):
    with pytest.raises(MisuseError):
        open_sensor(text)


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("nothing://here", "stdout://"),
        ("tracks.jsonl", "scheme"),
        ("file:///a?points=none", "option 'points'"),
        ("file://relative.jsonl", "file:///PATH"),
        ("file:///dev/null", "names no file"),
        ("udp://127.0.0.1", "udp://HOST:PORT"),
        ("udp://no.such.host.invalid:9", "unknown host"),
        ("unix://", "unix:///PATH"),
        ("unix:///" + 110 * "a", "107"),
        ("mcap://", "mcap:///PATH"),
        ("mcap:///tmp/a.mcap?max_mb=much", "max_mb"),
        ("mcap:///tmp/a.mcap?points=some", "points=all"),
        ("foxglove://no.such.host.invalid:1", "cannot be bound"),
    ],
)
def test_what_is_no_address_of_a_sink_is_refused_with_what_is_wrong(text, part):
    if text.startswith(("mcap", "foxglove")):
        pytest.importorskip("foxglove")
    with pytest.raises(MisuseError, match=re.escape(part)):
        open_sink(text)
