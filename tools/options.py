"""Command-line options shared by the tools."""

from __future__ import annotations

from argparse import ArgumentParser, RawDescriptionHelpFormatter


def parser(description: str | None) -> ArgumentParser:
    """A parser whose description is the module's docstring, line breaks kept."""
    return ArgumentParser(description=description, formatter_class=RawDescriptionHelpFormatter)


def make_torch_deterministic() -> None:
    """One thread, deterministic algorithms."""
    import torch

    torch.set_num_threads(1)
    torch.use_deterministic_algorithms(True)
