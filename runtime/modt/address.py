"""Addresses of sensors, sinks and senders of poses, in the form SCHEME://HOST:PORT/PATH?KEY=VALUE."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any
from urllib.parse import parse_qsl, urlsplit

from modt.errors import MisuseError, install


@dataclass(frozen=True)
class Address:
    """A parsed address.

    Attributes:
        text: the address as given.
        scheme, host, path: its parts; empty where not given.
        port: port, None where not given.
        options: options of the query.
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

    def choice(self, name: str, *values: str) -> str:
        """Value of an option, by default the first of `values`; MisuseError for any other value."""
        if (value := self.option(name, values[0])) not in values:
            choices = " or ".join(f"{name}={known}" for known in values)
            raise MisuseError(self.text, f"{name} {value!r} is unknown", f"write {choices}")
        return value


@dataclass(frozen=True)
class Scheme:
    """Form and opener of the addresses of a scheme.

    Attributes:
        form: form of its addresses, for messages and help.
        opener: function of an Address; it imports the modules that it needs, which may need an extra.
        options: names of the options that its addresses may have.
        extra: extra of modt that it needs.
    """

    form: str
    opener: Callable[..., Any]
    options: frozenset[str] = frozenset()
    extra: str = ""


def forms(schemes: Mapping[str, Scheme]) -> str:
    """Forms of the addresses of some schemes, for messages and help."""
    return ", ".join(scheme.form for scheme in schemes.values())


def parse_address(text: str, schemes: Mapping[str, Scheme]) -> Address:
    """Parse an address of one of these schemes.

    Raises:
        MisuseError: the scheme or an option is unknown, or the port is invalid.
    """
    try:
        parts = urlsplit(text)
        port = parts.port
        given = dict(parse_qsl(parts.query, keep_blank_values=True, strict_parsing=bool(parts.query)))
    except ValueError as error:
        raise MisuseError(text, f"no address ({error})", f"write one of {forms(schemes)}") from None
    if parts.scheme not in schemes:
        raise MisuseError(text, f"scheme {parts.scheme!r} is unknown", f"write one of {forms(schemes)}")
    allowed = schemes[parts.scheme].options
    unknown = sorted(set(given) - allowed)
    if unknown:
        known = ", ".join(sorted(allowed)) or "none"
        raise MisuseError(text, f"option {unknown[0]!r} is unknown", f"options of {parts.scheme}:// are: {known}")
    return Address(text, parts.scheme, parts.hostname or "", port, parts.path, given)


def open_address(text: str, schemes: Mapping[str, Scheme], *arguments: object) -> Any:
    """Open an address with the opener of its scheme and further arguments.

    Raises:
        MisuseError: the scheme or an option is unknown, an extra is missing, or the address cannot be opened.
    """
    address = parse_address(text, schemes)
    scheme = schemes[address.scheme]
    try:
        return scheme.opener(address, *arguments)
    except ModuleNotFoundError as error:
        raise MisuseError(text, f"needs {error.name}", install(scheme.extra)) from None
