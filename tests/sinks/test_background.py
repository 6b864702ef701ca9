"""Writing in the background."""

import os
import threading

import pytest

from modt.errors import ModtError
from modt.sinks.background import Background
from modt.sinks.output import LedgerSink

LIMIT_S = 60.0


class Slow:
    """A writer that waits for the test, and fails with the error that the test sets."""

    def __init__(self):
        self.items = []
        self.closed = threading.Event()
        self.failure = None
        self.entered = threading.Semaphore(0)
        self.released = threading.Semaphore(0)

    def write(self, item):
        self.entered.release()
        assert self.released.acquire(timeout=LIMIT_S)
        if self.failure is not None:
            raise self.failure
        self.items.append(item)

    def close(self):
        self.closed.set()


def settled(background, **expected):
    """Wait until its health has some values."""
    tick = threading.Event()
    for _ in range(int(LIMIT_S / 0.01)):
        if background.health().items() >= expected.items():
            return True
        tick.wait(0.01)
    return False


@pytest.fixture
def slow():
    writer = Slow()
    yield writer
    for _ in range(100):
        writer.released.release()


def test_items_are_written_in_their_order_and_a_full_queue_drops_its_oldest(slow):
    background = Background("test", slow, 3)
    background.write("in work")
    assert slow.entered.acquire(timeout=LIMIT_S)
    for n in range(5):
        background.write(n)
    assert background.health() == {"written": 0, "dropped": 2, "failed": 0, "waiting": 3, "state": "ok"}
    for _ in range(4):
        slow.released.release()
    background.close()
    assert slow.items == ["in work", 2, 3, 4]
    assert slow.closed.wait(LIMIT_S)
    assert background.health() == {"written": 4, "dropped": 2, "failed": 0, "waiting": 0, "state": "ok"}


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (ModtError("disk", "full", "free it"), "disk: full; free it"),
        (OSError("No space left on device"), "No space left on device"),
        (KeyError("x"), "KeyError: 'x'"),
    ],
)
def test_a_failure_is_logged_once_counted_and_tried_again(error, said, slow, caplog):
    background = Background("test", slow, 10, retry_s=0.0)
    slow.failure = error
    for n in range(3):
        background.write(n)
        slow.released.release()
    assert settled(background, failed=3, state=said)
    slow.failure = None
    background.write("again")
    slow.released.release()
    assert settled(background, written=1, state="ok")
    background.close()
    failed, again = caplog.records
    assert said in failed.getMessage()
    assert bool(failed.exc_info) == isinstance(error, KeyError)  # a traceback of what is no failure of the system
    assert "written again" in again.getMessage()
    assert slow.items == ["again"]


def test_what_cannot_be_encoded_is_counted_as_failed(slow):
    background = Background("test", slow, 10, encode=int)
    with pytest.raises(ValueError, match="invalid literal"):
        background.write("not a number")
    assert background.health()["failed"] == 1
    background.close()


def test_the_end_does_not_wait_for_a_writer_that_hangs(slow, caplog):
    background = Background("test", slow, 10)
    for n in range(3):
        background.write(n)
    assert slow.entered.acquire(timeout=LIMIT_S)
    closing = threading.Thread(target=background.close, daemon=True)
    closing.start()
    closing.join(LIMIT_S)
    assert not closing.is_alive()
    assert background.health()["dropped"] == 2
    assert "left alone" in caplog.text
    background.write("late")
    assert background.health()["dropped"] == 3


def test_a_real_time_loop_starts_its_writer_without_real_time_priority(slow):
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    except PermissionError:
        pytest.skip("real-time priority is not permitted")
    try:
        policies = []
        slow.write = lambda item: policies.append(os.sched_getscheduler(0))
        background = Background("test", slow, 10)
        background.write("frame")
        background.close()
    finally:
        os.sched_setscheduler(0, *before)
    assert policies == [os.SCHED_OTHER]


@pytest.mark.parametrize("takes", [False, True])
def test_lines_of_the_ledger_go_to_a_writer_that_takes_them(takes, slow):
    slow.health = lambda: {"unsent": 2, "written": 100}
    if takes:
        slow.ledger = slow.write
    background = Background("test", slow, 10)
    assert isinstance(background, LedgerSink)
    assert background.health() == {"unsent": 2, "written": 0, "dropped": 0, "failed": 0, "waiting": 0, "state": "ok"}
    for write, item in ((background.write, "frame"), (background.ledger, {"frame": 1})):
        write(item)
        slow.released.release()
    background.close()
    assert slow.items == (["frame", {"frame": 1}] if takes else ["frame"])
