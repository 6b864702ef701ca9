"""Addresses lead to the sink of their scheme."""

import sys
import threading
from importlib.util import find_spec

import pytest

from modt.errors import MisuseError
from modt.sinks.addresses import close_together, open_sink
from modt.sinks.schemes import SCHEMES, Scheme


def echo(address):
    return address


@pytest.fixture
def scheme(monkeypatch):
    monkeypatch.setitem(SCHEMES, "echo", Scheme(f"{__name__}:echo", "echo://", frozenset({"a"})))


def test_the_opener_of_the_scheme_has_the_address(scheme):
    address = open_sink("echo://here:7/there?a=b")
    assert (address.host, address.port, address.path, address.option("a")) == ("here", 7, "/there", "b")


def test_a_dash_is_standard_output(monkeypatch):
    monkeypatch.setitem(SCHEMES, "stdout", Scheme(f"{__name__}:echo", "stdout://"))
    assert open_sink("-").scheme == "stdout"


def test_an_extra_that_is_missing_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "foxglove", None)
    monkeypatch.delitem(sys.modules, "modt.sinks.foxglove_server", raising=False)
    monkeypatch.delitem(sys.modules, "modt.sinks.scene", raising=False)
    with pytest.raises(MisuseError, match=r"needs foxglove; pip install 'modt\[foxglove\]'"):
        open_sink("foxglove://")


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
    ],
)
def test_what_is_no_address_of_a_sink_is_one_line(text, part):
    with pytest.raises(MisuseError) as caught:
        open_sink(text)
    assert part in str(caught.value)


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("mcap://", "mcap:///PATH"),
        ("mcap:///tmp/a.mcap?max_mb=much", "max_mb"),
        ("mcap:///tmp/a.mcap?points=some", "points=all"),
        ("foxglove://no.such.host.invalid:1", "cannot be bound"),
    ],
)
def test_what_is_no_address_of_a_picture_is_one_line(text, part):
    pytest.importorskip("foxglove")
    with pytest.raises(MisuseError) as caught:
        open_sink(text)
    assert part in str(caught.value)


def test_a_sink_that_may_wait_is_written_in_the_background(monkeypatch):
    class Plain:
        def __init__(self, address):
            self.frames = []

        def write(self, result):
            self.frames.append((threading.current_thread().name, result))

        def close(self):
            pass

    made = []
    monkeypatch.setitem(globals(), "plain", lambda address: made.append(Plain(address)) or made[0])
    monkeypatch.setitem(SCHEMES, "plain", Scheme(f"{__name__}:plain", "plain://", depth=2))
    sink = open_sink("plain://")
    sink.write("frame")
    sink.close()
    assert made[0].frames == [("sink", "frame")]
    assert sink.health()["written"] == 1


def test_sinks_that_hang_are_closed_together():
    meeting = threading.Barrier(3, timeout=10.0)

    class Hanging:
        def close(self):
            meeting.wait()

    close_together([Hanging(), Hanging(), Hanging()])
    assert not meeting.broken


def test_every_opener_exists():
    for name, scheme in SCHEMES.items():
        assert scheme.form.startswith(f"{name}://")
        assert find_spec(scheme.opener.partition(":")[0])
