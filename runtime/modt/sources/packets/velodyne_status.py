"""The calibration that an HDL-64E sends with its packets, a byte in each of some."""

from __future__ import annotations

import json
from typing import Any

CYCLE = 4160
"""Packets in which all of it is sent."""
TAIL = slice(-6, None)
"""Stamp, type and value of a status."""


class CalibrationBytes:
    """Collects the ends of packets until they hold a calibration."""

    def __init__(self, library: Any) -> None:
        self._library = library
        self._tails: list[bytes] = []

    def add(self, payload: bytes) -> tuple[str, Any] | None:
        """Member of velodyne_decoder.Model and calibration of the unit, once they have been received whole."""
        self._tails.append(payload[TAIL])
        if len(self._tails) <= CYCLE:
            return None
        tails, self._tails = self._tails, []
        try:
            status = self._library.hdl64e.read_status_info(tails)
        except (ValueError, KeyError):  # packets are missing, or they hold no status
            return None
        if status["Calibration Time"] is None:
            return None
        table = self._library.hdl64e.status_info_to_calib_dict(status)
        del table["status"]
        member = f"HDL64E_{status['Model']}"
        return member, self._library.Calibration.from_string(json.dumps(table))
