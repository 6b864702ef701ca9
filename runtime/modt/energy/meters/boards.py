"""Boards whose power rails are known: the rails that sum to the module, and the rails that these feed.

Sources: NVIDIA's Jetson Linux developer guides and product design guides, and the device trees of the kernel.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Board:
    """A board, recognised by the model in its device tree and the labels of its rails."""

    name: str
    model: str  # pattern in the model of the device tree
    whole: tuple[str, ...]  # rails whose sum is the module's power
    cpu: str  # narrowest rail with the CPU
    parts: tuple[str, ...] = ()  # rails side by side that one of the whole feeds


BOARDS = (
    Board("Jetson Nano", r"Jetson Nano", ("POM_5V_IN",), "POM_5V_CPU", ("POM_5V_CPU", "POM_5V_GPU")),
    Board("Jetson NX", r"Xavier NX|Orin (NX|Nano)", ("VDD_IN",), "VDD_CPU_GPU_CV", ("VDD_CPU_GPU_CV", "VDD_SOC")),
    Board("Jetson AGX Xavier", r"AGX Xavier|Jetson-AGX", ("GPU", "CPU", "SOC", "CV", "VDDRQ", "SYS5V"), "CPU"),
    Board("Jetson AGX Orin", r"AGX Orin", ("VDD_GPU_SOC", "VDD_CPU_CV", "VIN_SYS_5V0"), "VDD_CPU_CV"),
)


def board_of(model: str, labels: Collection[str]) -> Board | None:
    """The board of a model in the device tree with these rails; by the rails alone where the model is empty."""
    for board in BOARDS:
        if {board.cpu, *board.whole}.issubset(labels) and (not model or re.search(board.model, model)):
            return board
    return None
