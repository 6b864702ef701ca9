"""Addresses lead to the opener of their scheme."""

import pytest

from modt.errors import MisuseError
from modt.sources.live import schemes
from modt.sources.live.schemes import Scheme, open_live


def echo(address, cores):
    return address.host, address.port, dict(address.options), cores


def test_the_opener_of_the_scheme_has_the_address_and_the_cores(monkeypatch):
    monkeypatch.setitem(schemes.SCHEMES, "echo", Scheme(f"{__name__}:echo", frozenset({"a"}), "echo://"))
    assert open_live("echo://here:7?a=b", frozenset({1})) == ("here", 7, {"a": "b"}, {1})


@pytest.mark.parametrize("text", ["nothing://here", "2368", "velodyne://here?colour=red"])
def test_an_unknown_scheme_or_option_is_refused(text):
    with pytest.raises(MisuseError):
        open_live(text)
