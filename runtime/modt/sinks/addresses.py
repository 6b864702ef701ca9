"""Sinks by the scheme of their address."""

from __future__ import annotations

from importlib import import_module

from modt.address import parse_address
from modt.errors import MisuseError
from modt.sinks.output import Sink
from modt.sinks.schemes import SCHEMES


def open_sink(text: str) -> Sink:
    """The sink at an address; "-" is standard output.

    Raises:
        MisuseError: an unknown scheme or option, or a missing extra.
        ModtError: what cannot be written.
    """
    address = parse_address("stdout://" if text == "-" else text, {name: s.options for name, s in SCHEMES.items()})
    scheme = SCHEMES[address.scheme]
    module, _, function = scheme.opener.partition(":")
    try:
        opener = getattr(import_module(module), function)
    except ModuleNotFoundError as error:
        raise MisuseError(text, f"needs {error.name}", f"pip install 'modt[{scheme.extra}]'") from None
    sink: Sink = opener(address)
    return sink
