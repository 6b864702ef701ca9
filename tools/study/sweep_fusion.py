"""Sweep the parameters of key views and fusion over drives with truth, followed by an ideal tracker.

    python -m tools.study.sweep_fusion [--world SCENE:SEED ...] [--check SCENE:SEED ...] [--frames N]
                         [--points N] [--page FILE] [--docs]
    python -m tools.study.sweep_fusion --own
    python -m tools.study.sweep_fusion --paper
    python -m tools.study.sweep_fusion --drive KITTI_RAW_DRIVE

Each drive is segmented and classified once; every setting then replays the fusion of the runtime over what the
network said. The defaults of the profile stand in every table; one value at a time is moved away from them. Average
precision over the proposals that are clearly one object or clearly none, from the frame in which a class is asked
for; calls relative to tracking by detection. No network was trained on the worlds (tools/train/build_models.py
takes seeds from 100000 on). What --world suggests --check must confirm: these are other worlds.

--own takes our own tracker in place of the ideal one, and pieces of objects and mergers for background. --paper is
the setting of Figs. 10 and 11: asked from the first frame, the number of points alone makes a view independent, and a
class that is settled stays so. --docs writes what belongs there into docs/classification.md.

A KITTI drive with tracklets stands in for the worlds, in the camera's view. Drive 0001 is five scans, of those that
pointnet-kitti was trained on. Drive 0005 is the test drive: it is refused unless --confirm is given, and then nothing
is swept on it.
"""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from modt import profile
from modt.classes import CLASS_NAMES
from modt.classification.fusion import EveryFrame, FirstView, KeyViews
from modt.classification.pointnet import PointNet
from modt.classification.prior import Prior, make_prior
from modt.config import FusionConfig, ProfileConfig
from modt.pipeline import Fusion
from modt.reporting import page, svg
from modt.sources.recognise import open_stream
from modt.sources.synthetic_stream import SyntheticStream
from modt.types import Frame
from tools.study.recording import Recording, record
from tools.study.replayed import Outcome, replay
from tools.train.labelled_scans import TEST_DRIVE, Scan, raw_scans
from tools.train.synthetic_scans import scan_of

WORLDS = ("street:2001", "street:2002", "crossing:2003")
CHECKS = ("street:3001", "street:3002", "crossing:3003", "street:3004", "street:3005", "crossing:3006")
PERIOD_S = 0.1
DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "log" / "fusion-sweep.md"
BEGIN, END = "<!-- tools/study/sweep_fusion.py -->\n", "<!-- end of tools/study/sweep_fusion.py -->"
OBJECTS = CLASS_NAMES[1:]
POINT_CHANGES = (0.05, 0.1, 0.16, 0.22, 0.3, 0.5, 1.0, 2.0)
ONCE = "first_view_min_object_probability"
"""The one that is mode efficient's."""
SWEEPS: dict[str, tuple[float | None, ...]] = {
    "start_frame": (1, 2, 3, 4, 5, 6, 7, 8),
    "object_threshold": (0.6, 0.7, 0.8, 0.85, 0.9, 0.95, 0.98),
    "background_threshold": (0.25, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9),
    "review_point_ratio": (1.5, 2.0, 3.0, 5.0, 10.0, None),
    "review_max_points": (30, 50, 100, 200, 400, 800),
    "min_object_probability": (0.0, 0.005, 0.01, 0.02, 0.05, 0.1),
    ONCE: (0.0, 0.01, 0.02, 0.05, 0.1, 0.2),
    "review_min_object_probability": (0.0, 0.02, 0.05, 0.1, 0.2),
    "box_update_weight": (0.0, 0.25, 0.5, 0.75, 1.0),
    "mismatch_probability": (0.0, 0.03, 0.1, 0.2, 0.3),
}
NO_BETTER = "No setting is better on both sets at no more calls."
DOUBTS = tuple(product((1.5, 2.0, 2.5), (30, 50, 100, 200)))
"""Ratio and points together: to doubt sooner costs calls, to doubt only what was seen far away saves them."""


@dataclass(frozen=True, slots=True)
class Setting:
    """A line of a table.

    Attributes:
        sweep: the table.
        value: what is different in it.
        fusion: makes it.
    """

    sweep: str
    value: str
    fusion: Callable[[Prior], Fusion]


@dataclass(frozen=True, slots=True)
class Tried:
    """A setting and what became of the drives, and of those it is checked on, if any, with it."""

    setting: Setting
    found: Outcome
    checked: Outcome | None

    @property
    def outcomes(self) -> tuple[Outcome, ...]:
        """Of both sets of drives."""
        return (self.found,) if self.checked is None else (self.found, self.checked)


def variants(config: FusionConfig) -> list[Setting]:
    """The ways of the method, and the defaults without one of their parts each."""
    uniform = dataclasses.replace(config, prior=(0.25, 0.25, 0.25))
    never = dataclasses.replace(config, review_point_ratio=None)
    title = "what makes the difference"
    return [
        Setting(title, "conventional", lambda prior: EveryFrame()),
        Setting(title, "first view (efficient)", lambda prior: FirstView(config, prior)),
        Setting(title, "first view, boxes unseen", lambda prior: FirstView(config)),
        Setting(title, "boxes unseen", lambda prior: KeyViews(config)),
        Setting(title, "uniform prior of views", lambda prior: KeyViews(uniform, prior)),
        Setting(title, "never doubting", lambda prior: KeyViews(never, prior)),
        Setting(title, "defaults", lambda prior: KeyViews(config, prior)),
    ]


def sweeps(config: FusionConfig) -> Iterator[Setting]:
    """One value at a time, the others as configured; of doubt both that there are."""
    default = config.point_change
    for k, name in enumerate(CLASS_NAMES):
        for value in sorted({*POINT_CHANGES, default[k]}):
            changes = {"point_change": (*default[:k], value, *default[k + 1 :])}
            yield _moved(config, f"point_change of {name}", _text(value), **changes)
    for key, values in SWEEPS.items():
        for moved in values:
            yield _moved(config, key, _text(moved), **{key: moved})
    for ratio, points in DOUBTS if config.review_point_ratio is not None else ():
        changes = {"review_point_ratio": ratio, "review_max_points": points}
        yield _moved(config, "review_point_ratio, review_max_points", f"{ratio:g}, {points}", **changes)


def _moved(config: FusionConfig, sweep: str, text: str, **changes: Any) -> Setting:
    moved = dataclasses.replace(config, **changes)
    made = FirstView if sweep == ONCE else KeyViews
    return Setting(sweep, f"{text} *" if moved == config else text, lambda prior: made(moved, prior))


def _text(value: float | None) -> str:
    return "none" if value is None else f"{value:g}"


def papers(config: ProfileConfig) -> ProfileConfig:
    """Views independent by their points alone, from the first frame on; no review, no box prior."""
    off = {"extent_change": 10.0, "review_point_ratio": None}
    off |= {
        "min_object_probability": 0.0,
        "first_view_min_object_probability": 0.0,
        "box_update_weight": 0.0,
        "mismatch_probability": 0.0,
    }
    return dataclasses.replace(
        config,
        fusion=dataclasses.replace(config.fusion, **off),
        tracking=dataclasses.replace(config.tracking, ask_from=1),
    )


def world(name: str, frames: int, config: ProfileConfig, network: PointNet, *, ideal: bool) -> Recording:
    """A synthetic drive, scene:seed, in the nominal camera's view."""
    scene, _, seed = name.partition(":")
    stream = SyntheticStream(scene, "hdl-64e", frames * PERIOD_S, int(seed))
    drive = ((frame, scan_of(frame, truth, name, name, camera=True)) for frame, truth in stream.sweeps())
    return record(name, drive, config, network, _prior(config, network), ideal=ideal)


def real(path: Path, config: ProfileConfig, network: PointNet, *, ideal: bool, confirm: bool) -> Recording:
    """A KITTI raw drive."""
    drive: Iterator[tuple[Frame, Scan]] = zip(open_stream(path), raw_scans(path, confirm=confirm), strict=True)
    return record(path.name, drive, config, network, _prior(config, network), ideal=ideal)


def _prior(config: ProfileConfig, network: PointNet) -> Prior:
    return make_prior(network.boxes, network.reflectance, config.fusion.prior, config.sensor)


def tried(setting: Setting, drives: Sequence[Recording], checks: Sequence[Recording], *when: int) -> Tried:
    """One setting on both sets of drives; when: frames of ask_from and judged_from."""
    checked = replay(checks, setting.fusion, *when) if checks else None
    return Tried(setting, replay(drives, setting.fusion, *when), checked)


def front(results: Sequence[Tried]) -> list[Tried]:
    """Those that no other one beats in precision at as few calls, cheapest first."""
    kept: list[Tried] = []
    for result in sorted(results, key=lambda r: (r.found.share, -r.found.mean)):
        if not kept or result.found.mean > kept[-1].found.mean:
            kept.append(result)
    return kept


def better(results: Sequence[Tried], default: Tried) -> list[Tried]:
    """Those more precise at no more calls than the default on every set of drives."""
    return [
        result
        for result in results
        if all(
            new.mean > old.mean and new.share <= old.share
            for new, old in zip(result.outcomes, default.outcomes, strict=True)
        )
    ]


def table(title: str, results: Sequence[Tried], default: Tried, *, named: bool = False) -> str:
    """A line for each setting: precision, calls, on how many drives it is better and worse than the default."""
    head = [title, *OBJECTS, "mean", "calls", *(("mean, checked", "calls, checked") if default.checked else ())]
    rows = []
    for result in results:
        name = f"{result.setting.sweep} {result.setting.value}" if named else result.setting.value
        cells = _cells(result.found) + (_cells(result.checked)[len(OBJECTS) :] if result.checked else [])
        rows.append([name, *cells, _drives(result, default)])
    return aligned([*head, "better, worse"], rows)


def spans(results: Sequence[Tried]) -> str:
    """A line for each sweep: how far it moves mean precision and calls, and where precision is best."""
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


def _best(members: Sequence[Tried], k: int) -> Tried:
    """The most precise of a sweep on one set of drives, to the digit that is shown; the default among equals."""
    return max(members, key=lambda r: (round(100 * r.outcomes[k].mean, 1), r.setting.value.endswith("*")))


def by_sweep(results: Sequence[Tried]) -> dict[str, list[Tried]]:
    """The settings of each sweep."""
    parts: dict[str, list[Tried]] = {}
    for result in results:
        parts.setdefault(result.setting.sweep, []).append(result)
    return parts


def aligned(head: list[str], body: Sequence[list[str]]) -> str:
    """A table for reading, and Markdown for the pages."""
    rows = [head, ["---"] * len(head), *body]
    width = [max(len(row[k]) for row in rows) for k in range(len(head))]
    return "\n".join(
        "| " + " | ".join(f"{cell:{'<' if k == 0 else '>'}{width[k]}}" for k, cell in enumerate(row)) + " |"
        for row in rows
    )


def _cells(outcome: Outcome) -> list[str]:
    precision = [f"{100 * outcome.precision[name]:.1f}" if name in outcome.precision else "-" for name in OBJECTS]
    return [*precision, f"{100 * outcome.mean:.1f}", f"{100 * outcome.share:.1f} %"]


def _drives(result: Tried, default: Tried) -> str:
    gain = np.subtract(
        [value for outcome in result.outcomes for value in outcome.each],
        [value for outcome in default.outcomes for value in outcome.each],
    )
    return f"{np.count_nonzero(gain > 0)}, {np.count_nonzero(gain < 0)}"


def drawn(results: Sequence[Tried], title: str, subtitle: str) -> str:
    """A page with average precision against calls, sweep by sweep."""
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


def report(first: Sequence[Tried], moved: Sequence[Tried], about: str) -> tuple[str, str]:
    """What belongs into the docs, and everything; the defaults are the last of the first."""
    default = first[-1]
    total = max(sum(default.found.calls.values()), 1)
    reasons = ", ".join(f"{100 * n / total:.0f} are {why}" for why, n in default.found.calls.items())
    short = [about, table(first[0].setting.sweep, first, default), f"Of 100 calls {reasons}."]
    whole = [*short, *(table(sweep, members, default) for sweep, members in by_sweep(moved).items())]
    if moved:
        winners = better(moved, default)
        ends = [
            spans(moved),
            table("better at no more calls", winners, default, named=True) if winners else NO_BETTER,
        ]
        short += ends
        whole += [table("front of precision and calls", front([*first, *moved]), default, named=True), *ends]
    return "\n\n".join(short), "\n\n".join(whole)


def renewed(text: str, section: str) -> str:
    """The document with this section between its marks."""
    before, rest = text.split(BEGIN)
    return f"{before}{BEGIN}\n{section}\n\n{END}{rest.split(END)[1]}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--world", nargs="+", default=WORLDS, metavar="SCENE:SEED", help="to sweep over")
    parser.add_argument("--check", nargs="*", default=CHECKS, metavar="SCENE:SEED", help="to confirm by")
    parser.add_argument("--frames", type=int, default=60, help="of each world")
    parser.add_argument("--drive", type=Path, help="a KITTI raw drive with tracklets in place of the worlds")
    parser.add_argument("--confirm", action="store_true", help="open the test drive, to confirm what is settled")
    parser.add_argument("--model", default="pointnet-kitti")
    parser.add_argument("--profile", default=profile.DEFAULT)
    parser.add_argument("--own", action="store_true", help="our own tracker in place of the ideal one")
    parser.add_argument("--paper", action="store_true", help="as the paper swept alpha and the starting frame")
    parser.add_argument("--points", type=int, default=0, help="judge only proposals of so many points or more")
    parser.add_argument("--page", type=Path, help="draw precision against calls into this HTML file")
    parser.add_argument("--docs", action="store_true", help="renew the figures of docs/classification.md")
    args = parser.parse_args()
    testing = args.drive is not None and args.drive.resolve().name == TEST_DRIVE
    if testing and not args.confirm:
        parser.error(f"{TEST_DRIVE} is the test drive: tune elsewhere, and give --confirm to confirm what is settled")
    if args.docs and (args.own or args.paper or args.drive or args.points):
        parser.error("--docs is of the whole sweep over worlds: leave out --own, --paper, --drive and --points")
    shipped = profile.load(args.profile)
    config = papers(shipped) if args.paper else shipped
    network = PointNet(dataclasses.replace(config.classification, model=args.model), config.sensor)
    if args.drive:
        drives, checks = [real(args.drive, config, network, ideal=not args.own, confirm=args.confirm)], []
    else:
        drives, checks = (
            [world(name, args.frames, config, network, ideal=not args.own) for name in names]
            for names in (args.world, args.check)
        )
    drives, checks = ([d.judged_from(args.points) for d in of] for of in (drives, checks))
    when = config.tracking.ask_from, shipped.tracking.ask_from
    first = [tried(setting, drives, checks, *when) for setting in variants(config.fusion)]
    moved = [] if testing else [tried(setting, drives, checks, *when) for setting in sweeps(config.fusion)]
    about = f"`{network.path.stem}` ({network.sha256[:8]}) on {', '.join(d.name for d in drives)}"
    about += f";\nchecked on {', '.join(d.name for d in checks)}." if checks else "."
    short, whole = report(first, moved, about)
    print(whole)
    if args.docs:
        DOCUMENT.write_text(renewed(DOCUMENT.read_text(encoding="utf-8"), short), encoding="utf-8")
    if args.page:
        page.save(args.page, drawn(moved, "Fusion: precision against calls", about))


if __name__ == "__main__":
    main()
