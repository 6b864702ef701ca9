"""Command-line options shared by the tools."""

from __future__ import annotations

from argparse import ArgumentParser, RawDescriptionHelpFormatter
from pathlib import Path


def parser(description: str | None) -> ArgumentParser:
    """A parser whose description is the module's docstring, line breaks kept."""
    return ArgumentParser(description=description, formatter_class=RawDescriptionHelpFormatter)


def crops_parser(description: str | None, seed: int) -> ArgumentParser:
    """Options of a tool that writes a data set of crops."""
    options = parser(description)
    options.add_argument("out", type=Path, help="file to write (.npz)")
    options.add_argument("--seed", type=int, default=seed)
    return options


def make_torch_deterministic() -> None:
    """One thread, deterministic algorithms."""
    import torch

    torch.set_num_threads(1)
    torch.use_deterministic_algorithms(True)
