import http.client
import json
import socket
import time
from contextlib import ExitStack, closing, suppress

import numpy as np
import pytest

from modt.address import parse_address
from modt.energy.ledger import StageWork
from modt.errors import MisuseError
from modt.geometry import rotation_zyx, se3
from modt.schemes import SINKS
from modt.types import PointKind
from modt.viewer import live_server
from modt.viewer.live_page import live_cells, open_view
from modt.viewer.live_server import MOST_CONNECTIONS, MOST_PAGES
from modt.viewer.packed import group_of
from modt.viewer.track_rows import COLUMNS
from tests import results

from . import pages

WAIT_S = 60.0


def opened(text):
    return open_view(parse_address(text, SINKS))


@pytest.fixture
def live():
    with closing(opened("view://:0")) as page:
        yield page


def show(live, *made, **more):
    """Write a frame and its line of the ledger."""
    frame = results.result(*made, **more)
    live.write(frame)
    live.ledger(results.ledger_line(frame.frame.index, tracking=StageWork(cpu_ns=2_000_000)))


class Reader:
    """Client that reads the events."""

    def __init__(self, live, path="/events", **headers):
        self.connection = http.client.HTTPConnection("127.0.0.1", live.port, timeout=WAIT_S)
        self.connection.request("GET", path, headers=headers)
        self.answer = self.connection.getresponse()

    def event(self):
        text = self.answer.readline().decode()
        assert self.answer.readline() == b"\n"
        return json.loads(text.removeprefix("data: "))

    def close(self):
        self.answer.close()
        self.connection.close()


@pytest.fixture
def read(live):
    with ExitStack() as readers:
        yield lambda *path, **headers: readers.enter_context(closing(Reader(live, *path, **headers)))


def test_metrics_are_served_beside_the_page(live, read):
    assert read("/metrics").answer.read() == b""
    live.status("a sensor: 10.0 Hz", "modt_up_s 2\n")
    answer = read("/metrics").answer
    assert answer.getheader("Content-Type").startswith("text/plain; version=0.0.4")
    assert answer.read() == b"modt_up_s 2\n"


def test_a_page_is_told_the_status_with_each_frame_and_by_itself_while_no_sweep_comes(live, read):
    live.status("a sensor: 0.0 Hz, sensor silent", "")
    reader = read()
    live.status("a sensor: 0.0 Hz, sensor silent", "")
    assert reader.event() == {"status": "a sensor: 0.0 Hz, sensor silent"}
    show(live, 0, [5], {0: 0})
    assert reader.event()["status"] == "a sensor: 0.0 Hz, sensor silent"
    live.status("a sensor: 10.0 Hz", "")  # sent with the next frame
    show(live, 1, [5], {0: 0})
    event = reader.event()
    assert (event["status"], event["frame"]["frame"]) == ("a sensor: 10.0 Hz", 1)


def test_connections_are_bounded(monkeypatch, request):
    monkeypatch.setattr(live_server.LiveServer, "request_queue_size", 2 * MOST_CONNECTIONS)
    monkeypatch.setattr(live_server, "SEND_S", WAIT_S)
    monkeypatch.setattr(live_server._Handler, "timeout", WAIT_S)
    live, read = map(request.getfixturevalue, ("live", "read"))  # only now: a server that waits as long as it takes
    with ExitStack() as idle:
        for _ in range(MOST_CONNECTIONS + 1):
            another = idle.enter_context(socket.create_connection(("127.0.0.1", live.port), WAIT_S))
        assert another.recv(1) == b"", "the one too many is closed"
    until = time.monotonic() + WAIT_S
    while True:  # those that left make room, each when its thread has seen it
        try:
            assert read("/").answer.status == 200
            break
        except (http.client.HTTPException, OSError):
            assert time.monotonic() < until


def test_one_that_asks_too_slowly_is_left(live, monkeypatch):
    monkeypatch.setattr(live_server, "SEND_S", 0.2)
    ends_s = time.monotonic() + WAIT_S
    closed = False
    with socket.create_connection(("127.0.0.1", live.port), 0.02) as slow, suppress(ConnectionError):
        slow.sendall(b"GET /")
        while not closed:
            assert time.monotonic() < ends_s
            slow.sendall(b"x")
            with suppress(TimeoutError):
                closed = not slow.recv(1)


def test_a_frame_reaches_a_client_with_the_energy_of_the_last_window(live, read):
    reader = read()
    T = se3(rotation_zyx(0.0, 0.0, 0.3), np.array([10.0, 1.0, 2.0]))
    live.ledger(results.energy_window(2.0))
    live.ledger(results.energy_window(None))
    show(live, 3, [5, 4], {0: 1, 1: 2}, {1: results.CAR}, T_world_sensor=T)
    event = reader.event()
    assert (event["frame"]["frame"], event["frame"]["cpu_ms"]) == (3, {"tracking": 2.0})
    assert (event["frame"]["energy_mJ"], event["frame"]["kind"]) == (200.0, "measured")
    assert event["frame"]["pose"] == [10.0, 1.0, 0.3]
    table = pages.table(event["tracks"], len(COLUMNS))
    assert table[:, COLUMNS.index("id")].tolist() == [1, 2]
    number, level = pages.cells(event["points"])
    assert len(number) == len(level)


def test_points_of_no_proposal_have_the_look_of_their_kind():
    shown = results.with_kinds(results.result(0, [5], {0: 1}, n_points=13))
    shown.frame.points[:, :2] = np.arange(13)[:, None] + 0.5
    cells = live_cells(shown)
    kind = shown.proposals.kind
    assert (cells.level == 0).tolist() == (kind == PointKind.GROUND).tolist()
    assert cells.group.tolist() == group_of(kind).tolist()


def test_nothing_is_made_without_a_client_nor_for_a_line_without_its_frame(live, read, monkeypatch):
    made = []
    monkeypatch.setattr("modt.viewer.live_page.live_message", lambda *given: made.append(given))
    show(live, 0, [5], {0: 1})
    reader = read()
    live.write(results.result(1, [5], {0: 1}))
    live.ledger(results.ledger_line(2))
    assert made == []
    assert reader.answer.status == 200


def test_one_that_stalls_holds_nobody_up_and_misses_what_is_old(live, read):
    stalled = socket.create_connection(("127.0.0.1", live.port), timeout=WAIT_S)
    with stalled:
        stalled.sendall(b"GET /events HTTP/1.0\r\nHost: localhost\r\n\r\n")
        assert stalled.recv(15).startswith(b"HTTP/1.0 200")
        reader = read()
        for index in range(300):
            show(live, index, [5, 4], {0: 1})
        seen = 0
        while seen < 299:
            seen = reader.event()["frame"]["frame"]


def test_too_many_are_refused(live, read):
    answers = [read().answer.status for _ in range(MOST_PAGES + 1)]
    assert answers == [200] * MOST_PAGES + [503]


@pytest.mark.parametrize(
    ("path", "name", "status"),
    [("/", "localhost:8766", 200), ("/etc", "127.0.0.1", 404), ("/", "elsewhere.example", 403), ("/events", "", 403)],
)
def test_other_paths_and_names_are_refused(read, path, name, status):
    assert read(path, Host=name).answer.status == status


@pytest.mark.parametrize("address", ["view://127.0.0.1:{port}", "view://192.0.2.1:0"])
def test_what_cannot_be_bound_is_one_error(live, address):
    with pytest.raises(MisuseError, match="cannot be bound"):
        opened(address.format(port=live.port))
