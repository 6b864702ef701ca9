"""Results as one Markdown document: quantities or swept values across, streams and variants down."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator, Sequence
from pathlib import Path

from modt import host, profile
from modt.app import assembly
from modt_evaluation.experiments.catalogue import Experiment
from modt_evaluation.experiments.study import Row

_MOST = 6
"""Greatest number of values of a sweep in a table. The CSV file has all."""
CURVES = "precision "
"""Beginning of quantities that no table shows."""
_NOT_THERE = "-"


def markdown(command: str, sources: str, experiments: Sequence[Experiment], rows: Sequence[Row]) -> str:
    """Results in tables, streams of development last."""
    return "\n".join([*_head(command, sources, rows), *_body(experiments, rows)]) + "\n"


def _head(command: str, sources: str, rows: Sequence[Row]) -> Iterator[str]:
    yield from ("# Results", "", f"{ABOUT}:", "", f"    {command}", "", f"{sources}. {reading(rows)}", "")


ABOUT = "The paper's tables and figures (its section VI), made by this command"


def reading(rows: Sequence[Row]) -> str:
    """Sentences on how the results are read."""
    development = ", ".join(sorted({row.streams for row in rows if row.development})) or "none"
    return (
        "In brackets: the 95 % interval of a bootstrap over objects (beta, false alarms: over tracks), "
        'not given of a single one; after "paper": what the paper states, over its eight drives where not of '
        "the drive itself. Simulated drives and KITTI's stand apart; drives that choices of this project were "
        f"confirmed on come last: {development}. Curves and whole sweeps are in results.csv beside this file."
    )


def _body(experiments: Sequence[Experiment], rows: Sequence[Row]) -> Iterator[str]:
    for experiment in experiments:
        listed = tabulated(experiment, rows)
        if not listed:
            continue
        yield from ("", f"## {experiment.title}", "", *([experiment.note, ""] if experiment.note else []))
        head, *lines = table(experiment, listed)
        for cells in (head, ["---"] * len(head), *lines):
            yield f"| {' | '.join(cells)} |"


def tabulated(experiment: Experiment, rows: Sequence[Row]) -> list[Row]:
    """The rows of an experiment that its table shows, which are all but its curves."""
    made = (row for row in rows if row.experiment == experiment.name)
    return [row for row in made if not row.quantity.startswith(CURVES)]


def table(experiment: Experiment, rows: Sequence[Row]) -> Iterator[Sequence[str]]:
    """Heading and lines. The columns are quantities, or the values of a sweep."""
    several = len({row.profile for row in rows}) > 1
    swept = sorted({row.at for row in rows if row.at is not None})
    lines: dict[tuple[str, ...], dict[str | float | None, str]] = {}
    for row in rows:
        variant = f"{row.variant}, profile {row.profile}" if several else row.variant
        line = (row.streams, variant, *([row.quantity] if swept else []))
        lines.setdefault(line, {})[row.at if swept else row.quantity] = _cell(row)
    columns: dict[str | float | None, str] = {}
    if swept:
        if any(row.at is None for row in rows):
            columns[None] = "not swept"
        columns.update((at, f"{at:g}") for at in _spread(swept))
        columns[swept[0]] = f"{experiment.swept} {swept[0]:g}"
    else:
        columns.update((row.quantity, row.quantity) for row in rows)
    head = ("streams", "variant", *(["quantity"] if swept else []), *columns.values())
    yield head
    for line, cell in lines.items():
        yield (*line, *(cell.get(column, _NOT_THERE) for column in columns))


def _spread(values: Sequence[float]) -> list[float]:
    """Values thinned to _MOST at most, the ends included."""
    if len(values) <= _MOST:
        return list(values)
    return [values[round(k * (len(values) - 1) / (_MOST - 1))] for k in range(_MOST)]


def number(value: float) -> str:
    """A number with three digits."""
    return f"{value:.0f}" if abs(value) >= 100 or value == int(value) else f"{value:.3g}"


def _cell(row: Row) -> str:
    if row.value is None:
        return _NOT_THERE
    text = number(row.value)
    if row.low is not None and row.high is not None:
        text += f" ({number(row.low)} to {number(row.high)})"
    return text if row.paper is None else f"{text}; paper {number(row.paper)}"


def sources(profiles: Sequence[Sequence[str]]) -> str:
    """A sentence: the commit, and the networks of these profiles."""
    configs = [profile.load(list(names)) for names in profiles]
    facts = [assembly.network(config.classification, config.sensor).facts() for config in configs]
    models = ", ".join(dict.fromkeys(f"{found['file']} ({found['sha256'][:12]})" for found in facts))
    return f"Commit {commit()}, model {models}"


def commit() -> str:
    """Commit of the checkout, else the version."""
    git = ["git", "-C", str(Path(__file__).parent), "describe", "--always", "--dirty", "--exclude=*"]
    try:
        return subprocess.run(git, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return f"version {host.versions()['modt']}"
