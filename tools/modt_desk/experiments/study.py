"""Experiments on drives: which replays they need, and the rows of figures that follow."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import chain
from types import MappingProxyType

import numpy as np

from modt import profile
from modt.config import EnergyConfig
from modt_desk.experiments import paper
from modt_desk.experiments.catalogue.experiment import Experiment, Label
from modt_desk.experiments.catalogue.figures import Figure
from modt_desk.experiments.drives import KITTI, SIMULATED, Drive
from modt_desk.experiments.judged import Judged
from modt_desk.experiments.store import Arrays, Store, catalogue_digest, key_of
from modt_desk.experiments.units import Executor, Unit

DIGITS = 6
DEFAULT = "default"
Profiles = tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Row:
    """A figure of some streams, beside the paper's.

    Attributes:
        experiment: its name.
        streams: drives that it is of.
        kind: KITTI or simulated.
        profile: names of the profiles on top of that of the sensor, DEFAULT for none.
        had_a_say: whether a choice of this project was confirmed on sweeps of one of them.
        variant, at, quantity: as in Figure.
        value, low, high: the figure and its 95 % interval, None where there is none.
        n: objects or tracks that were resampled.
        paper, paper_over: what the paper states, and of which drives.
    """

    experiment: str
    streams: str
    kind: str
    profile: str
    had_a_say: bool
    variant: str
    at: float | None
    quantity: str
    value: float | None
    low: float | None
    high: float | None
    n: int | None
    paper: float | None
    paper_over: str | None


@dataclass(frozen=True, slots=True)
class Streams:
    """Drives whose objects are pooled."""

    name: str
    drives: tuple[Drive, ...]

    @property
    def had_a_say(self) -> bool:
        """Whether one of them had."""
        return any(drive.had_a_say for drive in self.drives)


class Study:
    """Some experiments on some drives.

    Args:
        experiments: to make.
        drives: to make them on.
        profiles: each some names or files on top of that of a drive's sensor, compared with one another; labels
            alone follow from none of them.
        store: of results.
        boards: calibrations, of the networks of such profiles.
    """

    def __init__(
        self,
        experiments: Sequence[Experiment],
        drives: Sequence[Drive],
        profiles: Sequence[Profiles],
        store: Store,
        boards: Mapping[Profiles, EnergyConfig] = MappingProxyType({}),
    ) -> None:
        self._experiments, self._profiles, self._store = experiments, profiles, store
        self._boards = boards
        self._digests = {drive: drive.digest() for drive in drives}
        sensors = {drive.sensor for drive in drives}
        configs = {(sensor, names): profile.load((sensor, *names)) for sensor in sensors for names in profiles}
        self._units: dict[tuple[str, Profiles, Drive], dict[Label, Unit]] = {
            (e.name, names, drive): {
                label: Unit.of(drive, self._digests[drive], replay)
                for label, replay in e.replays(configs[drive.sensor, names]).items()
            }
            for e in experiments
            for names in self._compared(e)
            for drive in _suited(e, drives)
        }

    @property
    def units(self) -> list[Unit]:
        """All that are needed, each once, drive by drive, and what has a basis in common together."""
        found = {unit.key: unit for units in self._units.values() for unit in units.values()}
        order = list(self._digests)
        return sorted(found.values(), key=lambda unit: (order.index(unit.drive), unit.basis))

    def complete(self, executor: Executor, tick: Callable[[Unit], None]) -> None:
        """Work off the units whose outcomes are missing; those that are ready stay, should it be interrupted."""
        missing = [unit for unit in self.units if not self._store.has(unit.key)]
        for unit, outcome in executor.outcomes(missing, self._store.folder):
            self._store.put(unit.key, outcome)
            tick(unit)

    @property
    def missing(self) -> int:
        """Units without an outcome."""
        return sum(not self._store.has(unit.key) for unit in self.units)

    def rows(self) -> list[Row]:
        """Of every experiment, streams that had no say in choices first."""
        return [
            row
            for e in self._experiments
            for streams in self._streams(e)
            for names in self._compared(e)
            for row in self._rows(e, streams, names)
        ]

    def _compared(self, experiment: Experiment) -> Sequence[Profiles]:
        return self._profiles if experiment.scans else self._profiles[:1]

    def _streams(self, experiment: Experiment) -> Iterator[Streams]:
        suited = _suited(experiment, list(self._digests))
        simulated = tuple(drive for drive in suited if drive.kind == SIMULATED)
        if simulated:
            yield Streams(f"{len(simulated)} simulated drives", simulated)
        recorded = [drive for drive in suited if drive.kind == KITTI]
        once = tuple({drive.number: drive for drive in recorded}.values())
        if len(once) > 1:
            yield Streams(f"{len(once)} KITTI drives", once)
        for drive in sorted(recorded, key=lambda drive: drive.had_a_say):
            yield Streams(drive.name, (drive,))

    def _rows(self, experiment: Experiment, streams: Streams, names: Profiles) -> list[Row]:
        units = [self._units[experiment.name, names, drive] for drive in streams.drives]
        keys = [[unit.key for unit in of_drive.values()] for of_drive in units]
        unit_J = self._board(names).coefficients
        key = key_of("figures", catalogue_digest(), experiment.name, streams.name, names, keys, unit_J)

        def make() -> Arrays:
            return {
                "rows": np.array(json.dumps([asdict(row) for row in self._made(experiment, streams, names, units)]))
            }

        return [Row(**row) for row in json.loads(str(self._store.made(key, make)["rows"]))]

    def _made(
        self, experiment: Experiment, streams: Streams, names: Profiles, units: Sequence[Mapping[Label, Unit]]
    ) -> list[Row]:
        outcomes = {
            label: Judged.pooled([self._outcome(of_drive[label]) for of_drive in units]) for label in units[0]
        }
        figures = chain(experiment.figures(outcomes), experiment.energies(outcomes, self._board(names)))
        return [_row(experiment, streams, names, figure) for figure in figures]

    def _board(self, names: Profiles) -> EnergyConfig:
        return self._boards.get(names, EnergyConfig())

    def _outcome(self, unit: Unit) -> Judged:
        """As stored; made again if that is broken."""
        made = self._store.made(unit.key, lambda: unit.replay.judged(unit.drive, unit.digest, self._store).arrays())
        return Judged.of_arrays(made)


def _suited(experiment: Experiment, drives: Sequence[Drive]) -> list[Drive]:
    """With sweeps where they are needed; of labels alone, KITTI's."""
    return [drive for drive in drives if (drive.scans if experiment.scans else drive.kind == KITTI)]


def _row(experiment: Experiment, streams: Streams, names: Profiles, figure: Figure) -> Row:
    estimate, kind = figure.estimate, streams.drives[0].kind
    stated = paper.figure(experiment.name, streams.name, figure.variant, figure.at, figure.quantity)
    return Row(
        experiment=experiment.name,
        streams=streams.name,
        kind=kind,
        profile=" + ".join(names) or DEFAULT,
        had_a_say=experiment.scans and streams.had_a_say,
        variant=figure.variant,
        at=figure.at,
        quantity=figure.quantity,
        value=_rounded(estimate.value),
        low=_rounded(estimate.low),
        high=_rounded(estimate.high),
        n=estimate.n,
        paper=stated[0] if stated and kind == KITTI else None,
        paper_over=stated[1] if stated and kind == KITTI else None,
    )


def _rounded(value: float | None) -> float | None:
    return None if value is None else float(f"{value:.{DIGITS}g}")
