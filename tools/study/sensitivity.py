"""Effect of every constant of the method on accuracy, track length and CPU time; writes docs/tuning.md.

    python -m tools.study.sensitivity RESULTS [--jobs N] [--scenes NAME ...] [--seconds S] [--seeds 700:702]
                                      [--only PART] [--cpu] [--write]

Each constant of `modt.tuning` is lowered and raised by 20 %, one at a time, and the same simulated drives of six
sensors are run with it in mode accurate. The difference to the shipped value is taken drive by drive: average
precision and track length [points], and classifications of a frame [%]. With --cpu its CPU time [%] is shown as
well, which means something only on a machine that does nothing else. A difference counts where its 95 % interval
excludes zero.

RESULTS is a JSON file to which every result is added as it comes; constants that it holds are not run again. --only
runs the constants whose name begins with PART. --write puts the tables of all results into the page.
"""

from __future__ import annotations

import ast
import inspect
import json
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
NOT_MEASURED = dict.fromkeys(SIGNS, "")


@dataclass(frozen=True, slots=True)
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


@dataclass(frozen=True, slots=True)
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


def tables(results: Mapping[str, Mapping[str, Any]], measures: Sequence[str]) -> str:
    """Markdown of the constants that matter most, and of every stage, with some of MEASURES.

    Constants without a result come last.
    """
    known = list(constants(tuning.MethodTuning()))
    known.sort(key=lambda constant: _weight(results.get(constant.name)), reverse=True)
    missing = sum(constant.name not in results for constant in known)
    drives = len(next(iter(results.values()))["+"][0])
    lines = [
        f"At commit `{commit()}`, {drives} drives; made by `python -m {MARK}`.",
        f"{missing} values, shown with -, were not measured.",
        "By chance alone one difference in twenty is bold.",
        "",
        f"### The {TOP} that matter most",
        "",
        *_table([(constant.name, constant) for constant in known[:TOP]], results, measures),
    ]
    for stage in [field.name for field in fields(tuning.MethodTuning)]:
        own = [(constant.name.removeprefix(f"{stage}."), constant) for constant in known if constant.path[0] == stage]
        lines += ["", f"### {stage.capitalize()}", "", *_table(own, results, measures)]
    return "\n".join(lines)


def _table(
    named: Sequence[tuple[str, Constant]], results: Mapping[str, Mapping[str, Any]], measures: Sequence[str]
) -> Iterator[str]:
    """Rows of constants under the names that are shown."""
    shown = [f"{measure}, {sign}20 %" for sign in SIGNS for measure in measures]
    head = ["constant", "value", "meaning", "chosen on", *shown]
    yield f"| {' | '.join(head)} |"
    yield "|---" * len(head) + "|"
    for name, constant in named:
        result = results.get(constant.name, NOT_MEASURED)
        cells = [cell for sign in SIGNS for cell in _cells(result[sign], len(measures))]
        meaning, _, chosen = constant.meaning.partition("Chosen on: ")
        yield f"| `{name}` | {constant.value:g} | {meaning.strip()} | {chosen} | {' | '.join(cells)} |"


def _weight(result: Mapping[str, Any] | None) -> tuple[float, float]:
    """Largest effect on accuracy or track length whose interval excludes zero, then the largest of all [points]."""
    if result is None:
        return -1.0, -1.0
    found = [np.array(row) for sign in SIGNS if not isinstance(result[sign], str) for row in result[sign][:2]]
    effects = [(abs(float(row.mean())), margin(row)) for row in found]
    certain = [effect for effect, width in effects if effect > width]
    return max(certain, default=0.0), max((effect for effect, _ in effects), default=0.0)


def _cells(side: str | list[list[float]], n: int = len(MEASURES)) -> list[str]:
    if not side:
        return ["-"] * n
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
    wanted = [one for one in constants(tuning.MethodTuning()) if one.name.startswith(asked.only)]
    missing = [one for one in wanted if one.name not in results]
    if missing:
        drives = tuple(product(asked.scenes, SENSORS, (asked.seconds,), range(*asked.seeds)))
        few = [missing[k : k + TOGETHER] for k in range(0, len(missing), TOGETHER)]
        with Engine(asked.jobs) as engine:
            for _, found in engine.results(partial(run, drives), few):
                results |= {result["name"]: result for result in found}
                asked.results.write_text(json.dumps(results))
                for result in found:
                    print(result["name"], *(" ".join(_cells(result[sign])) for sign in SIGNS), sep="  ", flush=True)
    if asked.write:
        update(PAGE, MARK, tables(results, MEASURES if asked.cpu else MEASURES[:-1]))


if __name__ == "__main__":
    main()
