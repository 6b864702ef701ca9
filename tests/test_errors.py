"""Errors with a remedy."""

import pickle

import pytest

from modt.errors import MisuseError, ModtError, ScanError


@pytest.mark.parametrize("kind", [ModtError, MisuseError, ScanError])
def test_an_error_reaches_another_process_whole(kind):
    error = kind("a.bin", "is empty", "copy it again")
    received = pickle.loads(pickle.dumps(error))
    assert type(received) is kind
    assert str(received) == str(error) == "a.bin: is empty; copy it again"
    assert (received.subject, received.cause, received.remedy) == ("a.bin", "is empty", "copy it again")
