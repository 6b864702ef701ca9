"""Results as JSON, CSV, SVG, PNG and pages."""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path

from modt.sinks.output import writing
from modt_desk.experiments.catalogue.experiment import Experiment
from modt_desk.experiments.output import charts, png
from modt_desk.experiments.output.about import About
from modt_desk.experiments.output.html import html
from modt_desk.experiments.output.markdown import markdown
from modt_desk.experiments.study import Row

SCHEMA = "modt.experiments/1"


def write(out: Path, about: About, experiments: Sequence[Experiment], rows: Sequence[Row]) -> list[Path]:
    """Everything, below a folder; returns the files.

    Raises:
        ModtError: a file cannot be written.
    """
    texts = {"results.json": _json(about, rows)}
    for experiment in experiments:
        own = [row for row in rows if row.experiment == experiment.name]
        texts[f"{experiment.name}.csv"] = _csv(own)
        for streams, chart, drawn in charts.drawings(experiment, own):
            name = re.sub(r"[^\w.]+", "-", f"{experiment.name}-{streams}-{chart.title}")
            texts[f"{name}.svg"] = charts.standalone(f"{experiment.title}: {streams}", chart, drawn)
    texts["results.md"] = markdown(about, experiments, rows)
    texts["index.html"] = html(about, experiments, rows)
    contents = {name: text.encode() for name, text in texts.items()} | dict(png.pictures(texts))
    for name, content in contents.items():
        with writing(out / name):
            out.mkdir(parents=True, exist_ok=True)
            (out / name).write_bytes(content)
    return [out / name for name in contents]


def _json(about: About, rows: Sequence[Row]) -> str:
    return (
        json.dumps({"schema": SCHEMA, "about": asdict(about), "rows": [asdict(row) for row in rows]}, indent=1) + "\n"
    )


def _csv(rows: Sequence[Row]) -> str:
    out = io.StringIO()
    table = csv.DictWriter(out, [f.name for f in fields(Row)], lineterminator="\n")
    table.writeheader()
    table.writerows(asdict(row) for row in rows)
    return out.getvalue()
