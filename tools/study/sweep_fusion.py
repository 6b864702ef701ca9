"""Sweep the parameters of key views and fusion over drives with truth and an ideal tracker.

    python -m tools.study.sweep_fusion [--world SCENE:SEED ...] [--check SCENE:SEED ...] [--frames N]
                         [--points N] [--page FILE] [--docs]
    python -m tools.study.sweep_fusion --own
    python -m tools.study.sweep_fusion --paper
    python -m tools.study.sweep_fusion --drive KITTI_RAW_DRIVE

Each drive is segmented and classified once; every setting then replays the fusion on the recorded likelihoods. One
value at a time is changed from the profile. Average precision is over the proposals that are clearly one object or
clearly none, from the first frame in which a track may be classified; calls are relative to tracking by detection.
The worlds are in no training data (tools.train.build_models takes seeds from 100000 on); those of --check validate
the results of those of --world.

--own uses modt's tracker instead of the ideal one and counts fragments and merged objects as background. --paper is
the setting of Figs. 10 and 11: classification from the first frame, views independent by their number of points
alone, no review. --docs updates the tables of docs/log/fusion-sweep.md.

--drive replaces the worlds by a KITTI drive with tracklets, in the camera's view. Drive 0001 has five scans, which
are training data of pointnet-kitti. The test drive, 0005, requires --confirm, and no parameter is swept on it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from modt import profile
from modt.classes import CLASS_NAMES
from modt.classification.fusion import EveryFrame, KeyViews, OneView
from modt.classification.pointnet import PointNet
from modt.classification.prior import Prior, make_prior
from modt.config import FusionConfig, ProfileConfig
from modt.pipeline import Fusion
from modt.sources.recognise import open_stream
from modt.types import Frame
from modt_desk.reporting import page, svg
from modt_desk.simulation.synthetic_stream import SyntheticStream
from tools.options import parser
from tools.study.fusion_replay import Outcome, replay
from tools.study.recording import Recording, record
from tools.train.labelled_scans import TEST_DRIVE, Scan, raw_scans
from tools.train.synthetic_scans import labelled_scan

WORLDS = ("street:2001", "street:2002", "crossing:2003")
CHECKS = ("street:3001", "street:3002", "crossing:3003", "street:3004", "street:3005", "crossing:3006")
PERIOD_S = 0.1
DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "log" / "fusion-sweep.md"
BEGIN, END = "<!-- tools/study/sweep_fusion.py -->\n", "<!-- end of tools/study/sweep_fusion.py -->"
OBJECTS = CLASS_NAMES[1:]
POINT_CHANGES = (0.05, 0.1, 0.16, 0.22, 0.3, 0.5, 1.0, 2.0)
FIRST_VIEW = "first_view_"
"""Keys of mode `efficient` begin so."""
SWEEPS: dict[str, tuple[float | None, ...]] = {
    "start_frame": (1, 2, 3, 4, 5, 6, 7, 8),
    "object_threshold": (0.6, 0.7, 0.8, 0.85, 0.9, 0.95, 0.98),
    "background_threshold": (0.25, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9),
    "memory": (0.25, 0.35, 0.5, 0.7, 1.0),
    "review_point_ratio": (1.25, 1.5, 2.0, 3.0, 5.0, 10.0, None),
    "review_max_points": (30, 50, 100, 200, 400, 800),
    "min_object_probability": (0.0, 0.005, 0.01, 0.02, 0.05, 0.1),
    f"{FIRST_VIEW}min_object_probability": (0.0, 0.01, 0.02, 0.05, 0.1, 0.2),
    f"{FIRST_VIEW}background_threshold": (0.25, 0.4, 0.6, 0.8, 0.9, 1.0),
    "review_min_object_probability": (0.0, 0.02, 0.05, 0.1, 0.2),
    "box_update_weight": (0.0, 0.25, 0.5, 0.75, 1.0),
    "mismatch_probability": (0.0, 0.03, 0.1, 0.2, 0.3),
}
NO_BETTER = "No setting is better on both sets at no more calls."
REVIEWS = tuple(product((1.25, 1.5, 2.0), (30, 50, 100, 200)))
"""(review_point_ratio, review_max_points): a smaller ratio costs calls, fewer points save them."""


@dataclass(frozen=True, slots=True)
class Setting:
    """A line of a table.

    Attributes:
        sweep: title of the table.
        value: the changed value.
        fusion: makes the fusion from a prior.
    """

    sweep: str
    value: str
    fusion: Callable[[Prior], Fusion]


@dataclass(frozen=True, slots=True)
class Trial:
    """A setting with its outcome on the drives and on the checks, if any."""

    setting: Setting
    found: Outcome
    checked: Outcome | None

    @property
    def outcomes(self) -> tuple[Outcome, ...]:
        """On both sets of drives."""
        return (self.found,) if self.checked is None else (self.found, self.checked)


def variants(config: FusionConfig) -> list[Setting]:
    """The modes, and the defaults with one part removed each."""
    uniform = dataclasses.replace(config, prior=(0.25, 0.25, 0.25))
    never = dataclasses.replace(config, review_point_ratio=None)
    title = "variant"
    return [
        Setting(title, "conventional", lambda prior: EveryFrame()),
        Setting(title, "first view (efficient)", lambda prior: OneView(config, prior)),
        Setting(title, "first view, no box prior", lambda prior: OneView(config)),
        Setting(title, "no box prior", lambda prior: KeyViews(config)),
        Setting(title, "uniform class prior", lambda prior: KeyViews(uniform, prior)),
        Setting(title, "no review", lambda prior: KeyViews(never, prior)),
        Setting(title, "defaults", lambda prior: KeyViews(config, prior)),
    ]


def sweeps(config: FusionConfig) -> Iterator[Setting]:
    """One value changed at a time; for the review of final classes its two values together as well."""
    default = config.point_change
    for k, name in enumerate(CLASS_NAMES):
        for value in sorted({*POINT_CHANGES, default[k]}):
            point_change = (*default[:k], value, *default[k + 1 :])
            yield _changed(config, f"point_change of {name}", _text(value), point_change=point_change)
    for key, values in SWEEPS.items():
        for other in values:
            yield _changed(config, key, _text(other), **{key: other})
    for ratio, points in REVIEWS if config.review_point_ratio is not None else ():
        changes = {"review_point_ratio": ratio, "review_max_points": points}
        yield _changed(config, "review_point_ratio, review_max_points", f"{ratio:g}, {points}", **changes)


def _changed(config: FusionConfig, sweep: str, text: str, **changes: Any) -> Setting:
    changed = dataclasses.replace(config, **changes)
    made = OneView if sweep.startswith(FIRST_VIEW) else KeyViews
    return Setting(sweep, f"{text} *" if changed == config else text, lambda prior: made(changed, prior))


def _text(value: float | None) -> str:
    return "none" if value is None else f"{value:g}"


def paper_config(config: ProfileConfig) -> ProfileConfig:
    """The paper's fusion: views independent by their number of points alone; no review, no box prior."""
    off: dict[str, Any] = {"extent_change": 10.0}
    off |= {"review_point_ratio": None, "min_object_probability": 0.0, "first_view_min_object_probability": 0.0}
    off |= {"box_update_weight": 0.0, "mismatch_probability": 0.0}
    return dataclasses.replace(config, fusion=dataclasses.replace(config.fusion, **off))


def world(name: str, frames: int, config: ProfileConfig, network: PointNet, *, ideal: bool) -> Recording:
    """Record a simulated drive, SCENE:SEED, in the nominal camera's view."""
    scene, _, seed = name.partition(":")
    stream = SyntheticStream(scene, "hdl-64e", frames * PERIOD_S, int(seed))
    drive = ((frame, labelled_scan(frame, truth, name, name, camera=True)) for frame, truth in stream.sweeps())
    return record(name, drive, config, network, _prior(config, network), ideal=ideal)


def real(path: Path, config: ProfileConfig, network: PointNet, *, ideal: bool, confirm: bool) -> Recording:
    """Record a KITTI raw drive."""
    drive: Iterator[tuple[Frame, Scan]] = zip(open_stream(path), raw_scans(path, confirm=confirm), strict=True)
    return record(path.name, drive, config, network, _prior(config, network), ideal=ideal)


def _prior(config: ProfileConfig, network: PointNet) -> Prior:
    return make_prior(network.box_scores, config.fusion.prior)


def trial(setting: Setting, drives: Sequence[Recording], checks: Sequence[Recording]) -> Trial:
    """Replay a setting on both sets of drives."""
    checked = replay(checks, setting.fusion) if checks else None
    return Trial(setting, replay(drives, setting.fusion), checked)


def pareto_front(results: Sequence[Trial]) -> list[Trial]:
    """Trials whose precision no other trial reaches with as few calls, by increasing calls."""
    kept: list[Trial] = []
    for result in sorted(results, key=lambda r: (r.found.share, -r.found.mean)):
        if not kept or result.found.mean > kept[-1].found.mean:
            kept.append(result)
    return kept


def improvements(results: Sequence[Trial], default: Trial) -> list[Trial]:
    """Trials more precise than the default with no more calls on every set of drives."""
    return [
        result
        for result in results
        if all(
            new.mean > old.mean and new.share <= old.share
            for new, old in zip(result.outcomes, default.outcomes, strict=True)
        )
    ]


def table(title: str, results: Sequence[Trial], default: Trial, *, named: bool = False) -> str:
    """Markdown table of trials: precision, calls, number of drives better and worse than the default."""
    head = [title, *OBJECTS, "mean", "calls", *(("mean, checked", "calls, checked") if default.checked else ())]
    rows = []
    for result in results:
        name = f"{result.setting.sweep} {result.setting.value}" if named else result.setting.value
        cells = _cells(result.found) + (_cells(result.checked)[len(OBJECTS) :] if result.checked else [])
        rows.append([name, *cells, _drives(result, default)])
    return aligned([*head, "better, worse"], rows)


def sensitivity(results: Sequence[Trial]) -> str:
    """Markdown table of sweeps: range of mean precision and of calls, best value on each set of drives."""
    rows = []
    for sweep, members in by_sweep(results).items():
        mean = [100 * r.found.mean for r in members]
        calls = [100 * r.found.share for r in members]
        best = [_best(members, k).setting.value for k in range(len(members[0].outcomes))]
        values = f"{members[0].setting.value} to {members[-1].setting.value}".replace(" *", "")
        ends = [f"{min(mean):.1f} to {max(mean):.1f}", f"{min(calls):.1f} to {max(calls):.1f} %"]
        rows.append([sweep, values, *ends, *best])
    head = ["swept", "values", "mean", "calls", "best", "best, checked"]
    return aligned(head[: len(rows[0])] if rows else head, rows)


def _best(members: Sequence[Trial], k: int) -> Trial:
    """The most precise trial on set k of drives, rounded as in the table; the default among equals."""
    return max(members, key=lambda r: (round(100 * r.outcomes[k].mean, 1), r.setting.value.endswith("*")))


def by_sweep(results: Sequence[Trial]) -> dict[str, list[Trial]]:
    """Trials grouped by sweep."""
    parts: dict[str, list[Trial]] = {}
    for result in results:
        parts.setdefault(result.setting.sweep, []).append(result)
    return parts


def aligned(head: list[str], body: Sequence[list[str]]) -> str:
    """Markdown table with aligned columns."""
    rows = [head, ["---"] * len(head), *body]
    width = [max(len(row[k]) for row in rows) for k in range(len(head))]
    return "\n".join(
        "| " + " | ".join(f"{cell:{'<' if k == 0 else '>'}{width[k]}}" for k, cell in enumerate(row)) + " |"
        for row in rows
    )


def _cells(outcome: Outcome) -> list[str]:
    precision = [f"{100 * outcome.precision[name]:.1f}" if name in outcome.precision else "-" for name in OBJECTS]
    return [*precision, f"{100 * outcome.mean:.1f}", f"{100 * outcome.share:.1f} %"]


def _drives(result: Trial, default: Trial) -> str:
    gain = np.subtract(
        [value for outcome in result.outcomes for value in outcome.each],
        [value for outcome in default.outcomes for value in outcome.each],
    )
    return f"{np.count_nonzero(gain > 0)}, {np.count_nonzero(gain < 0)}"


def sweep_page(results: Sequence[Trial], title: str, subtitle: str) -> str:
    """HTML page with a plot of average precision against calls for each sweep."""
    items = []
    for sweep, members in by_sweep(results).items():
        calls = np.array([100 * r.found.share for r in members])
        traces = [
            svg.Trace(name, calls, np.array([100 * r.found.precision.get(name, np.nan) for r in members]))
            for name in OBJECTS
            if all(name in r.found.precision for r in members)
        ]
        dots = [dataclasses.replace(trace, name="", dots=True) for trace in traces]
        values = ", ".join(r.setting.value for r in members)
        picture = svg.lines([*traces, *dots], "calls [% of conventional]", "average precision [%]", log=True)
        items.append((sweep, picture, f"{values} (*: the default)"))
    return page.page(title, subtitle, [page.plots(items)])


def report(first: Sequence[Trial], moved: Sequence[Trial], about: str) -> tuple[str, str]:
    """Tables for the documentation, and all tables; the last of `first` is the default."""
    default = first[-1]
    total = max(sum(default.found.calls.values()), 1)
    reasons = ", ".join(f"{100 * n / total:.0f} are {why}" for why, n in default.found.calls.items())
    short = [about, table(first[0].setting.sweep, first, default), f"Of 100 calls {reasons}."]
    whole = [*short, *(table(sweep, members, default) for sweep, members in by_sweep(moved).items())]
    if moved:
        winners = improvements(moved, default)
        ends = [
            sensitivity(moved),
            table("better at no more calls", winners, default, named=True) if winners else NO_BETTER,
        ]
        short += ends
        front = pareto_front([*first, *moved])
        whole += [table("Pareto front of precision and calls", front, default, named=True), *ends]
    return "\n\n".join(short), "\n\n".join(whole)


def replace_section(text: str, section: str) -> str:
    """The document with the text between its marks replaced."""
    before, rest = text.split(BEGIN)
    return f"{before}{BEGIN}\n{section}\n\n{END}{rest.split(END)[1]}"


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--world", nargs="+", default=WORLDS, metavar="SCENE:SEED", help="drives to sweep over")
    options.add_argument("--check", nargs="*", default=CHECKS, metavar="SCENE:SEED", help="drives for validation")
    options.add_argument("--frames", type=int, default=60, help="of each world")
    options.add_argument("--drive", type=Path, help="a KITTI raw drive with tracklets in place of the worlds")
    options.add_argument("--confirm", action="store_true", help="allow the test drive, without sweeps")
    options.add_argument("--model", default="pointnet-kitti")
    options.add_argument("--profile", default=profile.DEFAULT)
    options.add_argument("--own", action="store_true", help="modt's tracker instead of the ideal one")
    options.add_argument("--paper", action="store_true", help="the setting of the paper's Figs. 10 and 11")
    options.add_argument("--points", type=int, default=0, help="minimum points of a scored proposal")
    options.add_argument("--page", type=Path, help="HTML file for plots of precision against calls")
    options.add_argument("--docs", action="store_true", help="update the tables of docs/log/fusion-sweep.md")
    args = options.parse_args()
    testing = args.drive is not None and args.drive.resolve().name == TEST_DRIVE
    if testing and not args.confirm:
        options.error(f"{TEST_DRIVE} is the test drive; sweep on another drive, or give --confirm for final scores")
    if args.docs and (args.own or args.paper or args.drive or args.points):
        options.error("--docs needs the whole sweep over worlds: leave out --own, --paper, --drive and --points")
    shipped = profile.load(args.profile)
    config = paper_config(shipped) if args.paper else shipped
    network = PointNet(dataclasses.replace(config.classification, model=args.model), config.sensor)
    if args.drive:
        drives, checks = [real(args.drive, config, network, ideal=not args.own, confirm=args.confirm)], []
    else:
        drives, checks = (
            [world(name, args.frames, config, network, ideal=not args.own) for name in names]
            for names in (args.world, args.check)
        )
    drives, checks = ([d.scored_from(args.points) for d in of] for of in (drives, checks))
    first = [trial(setting, drives, checks) for setting in variants(config.fusion)]
    moved = [] if testing else [trial(setting, drives, checks) for setting in sweeps(config.fusion)]
    about = f"`{network.path.stem}` ({network.sha256[:8]}) on {', '.join(d.name for d in drives)}"
    about += f";\nchecked on {', '.join(d.name for d in checks)}." if checks else "."
    short, whole = report(first, moved, about)
    print(whole)
    if args.docs:
        DOCUMENT.write_text(replace_section(DOCUMENT.read_text(encoding="utf-8"), short), encoding="utf-8")
    if args.page:
        page.save(args.page, sweep_page(moved, "Fusion: precision against calls", about))


if __name__ == "__main__":
    main()
