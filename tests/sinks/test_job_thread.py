"""Jobs run in order on another thread; what does not fit is refused and counted."""

import threading

from modt.errors import ModtError
from modt.sinks.job_thread import JobThread


def test_jobs_run_in_their_order_on_another_thread():
    done, threads = [], set()

    def job(k):
        done.append(k)
        threads.add(threading.get_ident())

    background = JobThread()
    for k in range(100):
        assert background.submit(lambda k=k: job(k))
    assert background.close(5.0)
    assert done == list(range(100))
    assert threading.get_ident() not in threads


def test_a_full_queue_refuses_and_counts():
    held, begun = threading.Event(), threading.Event()
    background = JobThread(capacity=2)
    background.submit(lambda: (begun.set(), held.wait(5.0)))
    assert begun.wait(5.0)
    assert [background.submit(lambda: None) for _ in range(4)] == [True, True, False, False]
    assert background.refused == 2
    assert not background.close(0.0)  # in time, though a job hangs
    held.set()
    assert background.close(5.0)


def test_a_job_that_fails_does_not_end_the_thread(caplog):
    done, background = [], JobThread()
    for job in (lambda: 1 / 0, lambda: 1 / 0, lambda: done.append(1)):
        background.submit(job)
    assert background.close(5.0)
    assert done == [1]
    assert len(caplog.records) == 1


def test_a_failure_with_a_remedy_is_one_line_and_any_other_a_traceback(caplog):
    def fail(error):
        raise error

    for error in (ModtError("disk", "full", "free it"), ValueError("x")):
        background = JobThread()
        background.submit(lambda error=error: fail(error))
        assert background.close(5.0)
    known, unknown = caplog.records
    assert (known.getMessage(), known.exc_info) == ("writer: disk: full; free it; later ones are only counted", None)
    assert unknown.exc_info
