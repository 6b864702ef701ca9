"""What every sink of files shares."""

import threading

from modt.sinks.output import close_together


def test_sinks_that_hang_are_closed_together():
    meeting = threading.Barrier(3, timeout=10.0)

    class Hanging:
        def close(self):
            meeting.wait()

    close_together([Hanging(), Hanging(), Hanging()])
    assert not meeting.broken
