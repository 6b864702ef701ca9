"""Addresses of sources and sinks: SCHEME://HOST:PORT/PATH?KEY=VALUE."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from urllib.parse import parse_qsl, urlsplit

from modt.errors import MisuseError


@dataclass(frozen=True, slots=True)
class Address:
    """A parsed address.

    Attributes:
        text: the address as given.
        scheme, host, path: its parts; empty where not given.
        port: None where not given.
        options: of the query.
    """

    text: str
    scheme: str
    host: str
    port: int | None
    path: str
    options: Mapping[str, str]

    def option(self, name: str, default: str = "") -> str:
        """Value of an option."""
        return self.options.get(name, default)


def parse_address(text: str, options: Mapping[str, frozenset[str]]) -> Address:
    """An address whose scheme is a key of `options`, with the options allowed to that scheme.

    Raises:
        MisuseError: another scheme or option, or no valid port.
    """
    schemes = ", ".join(f"{scheme}://" for scheme in sorted(options))
    try:
        parts = urlsplit(text)
        port = parts.port
        given = dict(parse_qsl(parts.query, keep_blank_values=True, strict_parsing=bool(parts.query)))
    except ValueError as error:
        raise MisuseError(text, f"no address ({error})", f"write one of {schemes}") from None
    if parts.scheme not in options:
        raise MisuseError(text, f"scheme {parts.scheme!r} is unknown", f"write one of {schemes}")
    allowed = options[parts.scheme]
    unknown = sorted(set(given) - allowed)
    if unknown:
        known = ", ".join(sorted(allowed)) or "none"
        raise MisuseError(text, f"option {unknown[0]!r} is unknown", f"options of {parts.scheme}:// are: {known}")
    return Address(text, parts.scheme, parts.hostname or "", port, parts.path, given)
