"""Experiments on drives, the replays that they need, and the figures that follow."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from modt import profile
from modt_evaluation.engine import Engine
from modt_evaluation.experiments import paper
from modt_evaluation.experiments.catalogue import Experiment, Label
from modt_evaluation.experiments.drives import Drive, KittiDrive
from modt_evaluation.experiments.figures import Figure
from modt_evaluation.experiments.judged import Judged, Replay

DIGITS = 6
DEFAULT = "default"
_CHUNK = 16
"""Consecutive tasks of one process, which segments a drive once for all of them."""
Profiles = tuple[str, ...]
"""Names or files on top of the profile of a drive's sensor."""
Task = tuple[Drive, Replay]


@dataclass(frozen=True)
class Row:
    """A figure of some streams, and the paper's figure.

    Attributes:
        experiment: its name.
        streams: drives that are pooled.
        kind: KITTI or simulated.
        profile: names of the profiles on top of that of the sensor, DEFAULT for none.
        development: whether a choice of this project was confirmed on sweeps of one of them.
        variant: variant that is compared.
        at, quantity: as in Figure.
        value, low, high: the figure and its 95 % interval, None where there is none.
        n: objects or tracks that were resampled.
        paper, paper_over: figures of the paper, and the drives they are taken over.
    """

    experiment: str
    streams: str
    kind: str
    profile: str
    development: bool
    variant: str
    at: float | None
    quantity: str
    value: float | None
    low: float | None
    high: float | None
    n: int | None
    paper: float | None
    paper_over: str | None


@dataclass(frozen=True)
class Study:
    """Some experiments on some drives.

    Attributes:
        experiments: experiments to make.
        drives: drives to make them on.
        profiles: profiles to compare, each on top of the profile of the sensor. Experiments on labels use the first.
    """

    experiments: Sequence[Experiment]
    drives: Sequence[Drive]
    profiles: Sequence[Profiles]

    def tasks(self) -> list[Task]:
        """Every replay once, drive by drive, so that those with the same segmentation follow one another."""
        needed = (
            (drive, replay)
            for drive in self.drives
            for names in self.profiles
            for e in self.experiments
            if names in self._compared(e) and drive in self._suited(e)
            for replay in _replays(e, drive, names).values()
        )
        return list(dict.fromkeys(needed))

    def rows(self, engine: Engine, tick: Callable[[str], None]) -> list[Row]:
        """Figures of every experiment, streams of development last; tick is called with the drive of each replay."""
        outcomes: dict[Task, Judged] = {}
        tasks = self.tasks()
        together = 1 if engine.local else _CHUNK
        parts = [tasks[first : first + together] for first in range(0, len(tasks), together)]
        for part, judged in engine.results(_replay_all, parts):
            outcomes |= zip(part, judged, strict=True)
            for drive, _ in part:
                tick(drive.name)
        return [
            _row(e, streams, drives, names, variant, figure)
            for e in self.experiments
            for streams, drives in self._streams(e)
            for names in self._compared(e)
            for variant, figure in _figures(e, drives, names, outcomes)
        ]

    def _compared(self, experiment: Experiment) -> Sequence[Profiles]:
        return self.profiles if experiment.scans else self.profiles[:1]

    def _suited(self, experiment: Experiment) -> list[Drive]:
        """Drives with sweeps, where these are needed. An experiment on labels alone suits KITTI's."""
        if experiment.scans:
            return [drive for drive in self.drives if drive.scans]
        return [drive for drive in self.drives if isinstance(drive, KittiDrive) and drive.further is None]

    def _streams(self, experiment: Experiment) -> Iterator[tuple[str, Sequence[Drive]]]:
        """Names of pooled drives, and the drives."""
        suited = self._suited(experiment)
        simulated = [drive for drive in suited if not isinstance(drive, KittiDrive)]
        if simulated:
            yield f"{len(simulated)} simulated drives", simulated
        recorded = [drive for drive in suited if isinstance(drive, KittiDrive)]
        once = list({drive.number: drive for drive in recorded if drive.further is None}.values())
        if len(once) > 1:
            yield f"{len(once)} KITTI drives", once
        for drive in sorted(recorded, key=lambda drive: drive.development):
            yield drive.name, [drive]


def _figures(
    experiment: Experiment, drives: Sequence[Drive], names: Profiles, outcomes: Mapping[Task, Judged]
) -> Iterator[tuple[str, Figure]]:
    """Variant and figure of an experiment on pooled drives."""
    found: dict[Label, list[Judged]] = {}
    for drive in drives:
        for label, replay in _replays(experiment, drive, names).items():
            found.setdefault(label, []).append(outcomes[drive, replay])
    for (variant, at), judged in found.items():
        for figure in experiment.figures(Judged.pooled(judged), at):
            yield variant, figure


def _replays(experiment: Experiment, drive: Drive, names: Profiles) -> Mapping[Label, Replay]:
    return experiment.replays(profile.load((drive.sensor, *names)))


def _replay_all(tasks: Sequence[Task]) -> list[Judged]:
    return [replay.judged(drive) for drive, replay in tasks]


def _row(
    experiment: Experiment, streams: str, drives: Sequence[Drive], names: Profiles, variant: str, figure: Figure
) -> Row:
    estimate = figure.estimate
    stated = paper.figure(experiment.name, streams, variant, figure.at, figure.quantity)
    as_labelled = isinstance(drives[0], KittiDrive) and drives[0].further is None
    paper_value, paper_over = stated if stated and as_labelled else (None, None)
    return Row(
        experiment=experiment.name,
        streams=streams,
        kind=drives[0].kind,
        profile=" + ".join(names) or DEFAULT,
        development=experiment.scans and any(drive.development for drive in drives),
        variant=variant,
        at=figure.at,
        quantity=figure.quantity,
        value=_rounded(estimate.value),
        low=_rounded(estimate.low),
        high=_rounded(estimate.high),
        n=estimate.n,
        paper=paper_value,
        paper_over=paper_over,
    )


def _rounded(value: float | None) -> float | None:
    return None if value is None else float(f"{value:.{DIGITS}g}")
