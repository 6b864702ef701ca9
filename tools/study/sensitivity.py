"""Effect of every constant of the method on accuracy, track length and CPU time; writes docs/tuning.md.

    python -m tools.study.sensitivity RESULTS [--jobs N] [--scenes NAME ...] [--seconds S] [--seeds 700:702]
                                      [--only PART] [--cpu] [--write]

Each constant of `modt.tuning` is lowered and raised by 20 %, one at a time, and the same simulated drives of six
sensors are run with it in mode accurate. The difference to the shipped value is taken drive by drive: average
precision and track length [points], and classifications of a frame [%]. With --cpu its CPU time [%] is shown as
well, which means something only on a machine that does nothing else. A difference counts where its 95 % interval
excludes zero.

RESULTS is a JSON file to which every result is added as it comes; constants that it holds are not run again. --only
runs the constants whose name begins with PART. --write runs nothing: it puts the results of RESULTS into the tables
of the page. Constants without a result keep what the page says of them, unless their value has changed since.
"""

from __future__ import annotations

import ast
import inspect
import json
import re
import textwrap
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass, fields, is_dataclass, replace
from functools import cache, partial
from itertools import pairwise, product
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import t as student_t

from modt import tuning
from modt.app import assembly
from modt.classes import CLASS_NAMES
from modt.cli.options import frames as number_range
from modt.types import Float64
from modt_evaluation.class_score import class_scores
from modt_evaluation.engine import Engine
from modt_evaluation.evaluation import collect
from modt_evaluation.experiments.markdown import commit
from modt_evaluation.frame import JudgedFrame
from modt_evaluation.track_score import track_scores
from tools.docs.sections import DOCS, update
from tools.options import parser
from tools.study.drives import Drive, simulated

PAGE = DOCS / "tuning.md"
MARK = "tools.study.sensitivity"
SENSORS = ("vlp-16", "os1-64", "hdl-64e", "mid-360", "pandar64", "xt-32")
SCENES = ("street", "crossing")
MODE = "accurate"
CHANGE = 0.2
"""Share by which a value is lowered and raised."""
TOP = 10
TOGETHER = 5
"""Constants that are compared with the same run of the shipped values."""
MEASURES = ("AP", "length", "calls", "CPU")
SIGNS = {"-": -CHANGE, "+": CHANGE}
UNKNOWN = "-"
EFFECT = re.compile(r"(?P<bold>\*\*)?(?P<points>[+-]?[\d.]+)(\*\*)?")
"""A cell of the page that holds a number."""
ROW = re.compile(r"^\| `(?P<name>\S+)` \| (?P<value>\S+) \| (?P<others>.*) \|$", re.MULTILINE)
"""A row of the page."""


@dataclass(frozen=True)
class Constant:
    """One number of the method.

    Attributes:
        path: fields that lead to it, from the top.
        value: shipped value.
        meaning: its docstring.
    """

    path: tuple[str, ...]
    value: float
    meaning: str

    @property
    def name(self) -> str:
        """The path as it is written in code."""
        return ".".join(self.path)

    def changed(self, share: float) -> float:
        """The value changed by a share; a whole number by one at least."""
        if isinstance(self.value, int):
            return self.value + int(np.copysign(max(1, round(abs(share) * self.value)), share))
        return self.value * (1.0 + share)


def constants(part: Any, path: tuple[str, ...] = ()) -> Iterator[Constant]:
    """Every finite number other than zero below a tuning, in the order of the fields."""
    meanings = field_docstrings(type(part))
    for field in fields(part):
        value = getattr(part, field.name)
        place = (*path, field.name)
        if is_dataclass(value):
            yield from constants(value, place)
        elif isinstance(value, int | float) and np.isfinite(value) and value != 0:
            yield Constant(place, value, meanings.get(field.name, ""))


def field_docstrings(kind: type) -> dict[str, str]:
    """The string below each field of a class."""
    body = ast.parse(textwrap.dedent(inspect.getsource(kind))).body[0].body  # type: ignore[attr-defined]
    found = {}
    for field, below in pairwise(body):
        if isinstance(field, ast.AnnAssign) and isinstance(below, ast.Expr):
            found[ast.unparse(field.target)] = " ".join(ast.literal_eval(below.value).split())
    return found


def with_value(part: Any, path: Sequence[str], value: float) -> Any:
    """A copy of a tuning in which one number has another value."""
    if not path:
        return value
    first, *rest = path
    return replace(part, **{first: with_value(getattr(part, first), rest, value)})


@dataclass(frozen=True)
class Score:
    """Figures of one drive."""

    precision: float  # mean average precision of the classes that occur [points]
    length: float  # track length over that of ideal tracking [points]
    calls: float  # classifications a frame
    cpu_ms: float  # CPU time of a frame


def score(drive: Drive, values: tuning.MethodTuning) -> Score:
    """Run and judge a drive."""
    mode = assembly.MODES[MODE]
    pipeline = assembly.pipeline(mode, drive.profile, drive.fov, tuning=values)
    # Without a budget of CPU time, whose effect depends on how busy the machine is.
    budget = replace(mode.budget(drive.profile), mean_ms=None)
    times_ns = []
    judged = []
    for frame, truth in drive.frames:
        start_ns = time.thread_time_ns()
        result = pipeline.step(frame, budget)
        times_ns.append(time.thread_time_ns() - start_ns)
        judged.append(JudgedFrame.of_result(result, truth, drive.fov))
    rows = collect(judged, drive.rules)
    by_class = class_scores(rows.objects, rows.proposals)
    precisions = [by_class[name].average_precision for name in CLASS_NAMES[1:] if name in by_class]
    length = track_scores(rows.objects, rows.proposals)["all"].life.ratio
    return Score(
        precision=100.0 * float(np.mean([p for p in precisions if p is not None])),
        length=100.0 * (length or 0.0),
        calls=rows.classified / rows.frames,
        cpu_ms=float(np.median(times_ns)) / 1e6,
    )


def differences(changed: Sequence[Score], shipped: Sequence[Score]) -> Float64:
    """(4, D) differences of MEASURES, drive by drive [points, points, %, %]."""
    after, before = (np.array([astuple(one) for one in scores]).T for scores in (changed, shipped))
    return np.concatenate([after[:2] - before[:2], 100.0 * (after[2:] / np.maximum(before[2:], 1e-9) - 1.0)])


def margin(difference: Float64) -> float:
    """Half of the 95 % interval of the mean of the (D,) differences of the drives."""
    n = len(difference)
    return float(student_t.ppf(0.975, n - 1) * difference.std(ddof=1) / np.sqrt(n))


def summary(difference: Float64) -> str:
    """Mean of the (D,) differences of the drives, bold where its 95 % interval excludes zero; 0 if all are zero."""
    mean = difference.mean()
    if abs(mean) > margin(difference):
        return f"**{mean:+.1f}**"
    return f"{mean:+.1f}" if difference.any() else "0"


@cache
def _simulated(*drive: Any) -> Drive:
    """A drive by the arguments of `simulated`, once in each process."""
    return simulated(*drive)


def run(wanted: Sequence[tuple[Any, ...]], few: Sequence[Constant]) -> list[dict[str, Any]]:
    """Differences that some constants make, lowered and raised, by the sign of the change; or why one cannot be run.

    The shipped values are run beside them, since CPU times drift.

    Args:
        wanted: arguments of `simulated` for each drive.
        few: constants.
    """
    drives = [_simulated(*drive) for drive in wanted]
    shipped = [score(drive, tuning.MethodTuning()) for drive in drives]
    return [{"name": constant.name} | _both_ways(drives, constant, shipped) for constant in few]


def _both_ways(drives: Sequence[Drive], constant: Constant, shipped: Sequence[Score]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for sign, share in SIGNS.items():
        values = with_value(tuning.MethodTuning(), constant.path, constant.changed(share))
        try:
            found[sign] = differences([score(drive, values) for drive in drives], shipped).tolist()
        except (ValueError, IndexError, ArithmeticError, AssertionError) as error:
            found[sign] = f"{type(error).__name__}: {error}"
    return found


def effects(results: Mapping[str, Mapping[str, Any]], n_measures: int) -> dict[str, list[str]]:
    """Cells of each constant that has a result: some measures of the value lowered, then of the value raised."""
    found = {}
    for name, result in results.items():
        found[name] = [cell for sign in SIGNS for cell in _cells(result[sign], n_measures)]
    return found


def effects_on_page(page: str, n_measures: int) -> dict[str, list[str]]:
    """Cells of each constant whose effect the page shows, and whose value is still the one it shows."""
    shipped = {constant.name: f"{constant.value:g}" for constant in constants(tuning.MethodTuning())}
    found = {}
    for stage in re.split(r"^### ", page, flags=re.MULTILINE)[2:]:  # the first part has no table, the second the top
        for row in ROW.finditer(stage):
            name = f"{stage.split()[0].lower()}.{row['name']}"
            cells = row["others"].split(" | ")[-len(SIGNS) * n_measures :]
            if shipped.get(name) == row["value"] and UNKNOWN not in cells:
                found[name] = cells
    return found


def tables(known: Mapping[str, Sequence[str]], measures: Sequence[str], n_drives: int) -> str:
    """Markdown of the constants that matter most, and of every stage. Constants of unknown effect come last.

    Args:
        known: cells of the constants whose effect is known.
        measures: those of MEASURES that the cells are of.
        n_drives: number of drives of the last results.
    """
    every = list(constants(tuning.MethodTuning()))
    every.sort(key=lambda constant: _weight(known.get(constant.name, ()), len(measures)), reverse=True)
    unknown = sum(constant.name not in known for constant in every)
    lines = [
        f"The last at commit `{commit()}`, {n_drives} drives; made by `python -m {MARK}`.",
        f"Values that were not measured, shown with {UNKNOWN}: {unknown}.",
        "By chance alone one difference in twenty is bold.",
        "",
        f"### The {TOP} that matter most",
        "",
        *_table([(constant.name, constant) for constant in every[:TOP]], known, measures),
    ]
    for stage in [field.name for field in fields(tuning.MethodTuning)]:
        own = [(constant.name.removeprefix(f"{stage}."), constant) for constant in every if constant.path[0] == stage]
        lines += ["", f"### {stage.capitalize()}", "", *_table(own, known, measures)]
    return "\n".join(lines)


def _table(
    named: Sequence[tuple[str, Constant]], known: Mapping[str, Sequence[str]], measures: Sequence[str]
) -> Iterator[str]:
    """Rows of constants under the names that are shown."""
    shown = [f"{measure}, {sign}20 %" for sign in SIGNS for measure in measures]
    head = ["constant", "value", "meaning", "chosen on", *shown]
    yield f"| {' | '.join(head)} |"
    yield "|---" * len(head) + "|"
    for name, constant in named:
        cells = known.get(constant.name, [UNKNOWN] * len(shown))
        meaning, _, chosen = constant.meaning.partition("Chosen on: ")
        yield f"| `{name}` | {constant.value:g} | {meaning.strip()} | {chosen} | {' | '.join(cells)} |"


def _weight(cells: Sequence[str], n_measures: int) -> tuple[float, float]:
    """Largest effect on accuracy or track length that is beyond doubt, then the largest of all [points]."""
    of_result = [cell for k, cell in enumerate(cells) if k % n_measures < 2]
    numbers = [found for found in map(EFFECT.fullmatch, of_result) if found]
    if not numbers:
        return -1.0, -1.0
    sizes = [abs(float(number["points"])) for number in numbers]
    bold_sizes = [size for size, number in zip(sizes, numbers, strict=True) if number["bold"]]
    return max(bold_sizes, default=0.0), max(sizes)


def _cells(side: str | list[list[float]], n: int = len(MEASURES)) -> list[str]:
    if isinstance(side, str):
        return ["refused"] * n
    return [summary(np.array(difference)) for difference in side[:n]]


def main() -> None:
    options = parser(__doc__)
    options.add_argument("results", type=Path)
    options.add_argument("--jobs", type=int, default=2)
    options.add_argument("--seconds", type=float, default=4.0)
    options.add_argument("--scenes", nargs="+", default=SCENES)
    options.add_argument("--seeds", type=number_range, default=(700, 701))
    options.add_argument("--only", default="")
    options.add_argument("--cpu", action="store_true")
    options.add_argument("--write", action="store_true")
    asked = options.parse_args()
    results: dict[str, Any] = json.loads(asked.results.read_text()) if asked.results.exists() else {}
    if asked.write and not results:
        options.error(f"{asked.results} holds no results: measure a constant first, without --write")
    if asked.write:
        measures = MEASURES if asked.cpu else MEASURES[:-1]
        known = effects_on_page(PAGE.read_text(), len(measures)) | effects(results, len(measures))
        n_drives = len(next(iter(results.values()))["+"][0])
        update(PAGE, MARK, tables(known, measures, n_drives))
        return
    wanted = [one for one in constants(tuning.MethodTuning()) if one.name.startswith(asked.only)]
    missing = [one for one in wanted if one.name not in results]
    drives = tuple(product(asked.scenes, SENSORS, (asked.seconds,), range(*asked.seeds)))
    few = [missing[k : k + TOGETHER] for k in range(0, len(missing), TOGETHER)]
    with Engine(asked.jobs) as engine:
        for _, found in engine.results(partial(run, drives), few):
            results |= {result["name"]: result for result in found}
            asked.results.write_text(json.dumps(results))
            for result in found:
                print(result["name"], *(" ".join(_cells(result[sign])) for sign in SIGNS), sep="  ", flush=True)


if __name__ == "__main__":
    main()
