"""Sinks by the scheme of their address."""

from __future__ import annotations

import threading
from collections.abc import Iterable
from importlib import import_module

from modt.address import parse_address
from modt.errors import MisuseError
from modt.sinks.background import Background
from modt.sinks.output import Sink
from modt.sinks.schemes import SCHEMES


def open_sink(text: str) -> Sink:
    """The sink at an address, which never waits; "-" is standard output.

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
    writer = opener(address)
    return Background(text, writer, scheme.depth) if scheme.depth else writer


def close_together(sinks: Iterable[Sink]) -> None:
    """Close sinks at the same time, so that several that hang delay the end no more than one."""
    threads = [threading.Thread(target=sink.close) for sink in sinks]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
