"""Addresses of topics: ros2:///NAME?domain=N."""

from __future__ import annotations

import os

from modt.address import Address
from modt.errors import MisuseError

MAX_DOMAIN = 232


def name_of(address: Address) -> str:
    """The name between ros2:// and the options, without slashes at its ends; with two slashes or three."""
    return address.text.partition("://")[2].partition("?")[0].strip("/")


def topic_of(address: Address) -> str:
    """The name of a topic.

    Raises:
        MisuseError: none.
    """
    name = name_of(address)
    if not name:
        raise MisuseError(address.text, "names no topic", "write ros2:///TOPIC")
    return name


def domain_of(address: Address) -> int:
    """The domain, ROS_DOMAIN_ID or else 0 where none is stated.

    Raises:
        MisuseError: no number of a domain.
    """
    text = address.option("domain") or os.environ.get("ROS_DOMAIN_ID", "") or "0"
    if not (text.isascii() and text.isdecimal()) or int(text) > MAX_DOMAIN:
        raise MisuseError(address.text, f"domain {text!r} is none", f"give a number from 0 to {MAX_DOMAIN}")
    return int(text)
