"""Addresses of topics: ros2:///NAME?domain=N."""

from __future__ import annotations

import os

from modt.address import Address
from modt.errors import MisuseError

MAX_DOMAIN = 232


def name_of(address: Address) -> str:
    """The name after ros2:// or ros2:///, without slashes at its ends."""
    return address.text.partition("://")[2].partition("?")[0].strip("/")


def topic_of(address: Address) -> str:
    """The name of a topic.

    Raises:
        MisuseError: the address has no name.
    """
    name = name_of(address)
    if not name:
        raise MisuseError(address.text, "names no topic", "write ros2:///TOPIC")
    return name


def domain_of(address: Address) -> int:
    """The domain of the address, else ROS_DOMAIN_ID, else 0.

    Raises:
        MisuseError: not the number of a domain.
    """
    text = address.option("domain") or os.environ.get("ROS_DOMAIN_ID", "") or "0"
    if not (text.isascii() and text.isdecimal()) or int(text) > MAX_DOMAIN:
        raise MisuseError(address.text, f"domain {text!r} does not exist", f"give a number from 0 to {MAX_DOMAIN}")
    return int(text)
