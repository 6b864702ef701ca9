"""The stages of a service: chosen by the first sweep, exchanged by a reload or after failures."""

from __future__ import annotations

from dataclasses import replace
from threading import Thread
from typing import Any, Protocol

import numpy as np

from modt import host
from modt.app import inputs
from modt.app.chosen_profile import ChosenProfile, choose
from modt.app.parts import Parts, pipeline_of
from modt.app.sensor_watch import SensorWatch
from modt.energy.ledger import Ledger
from modt.odometry.odometry import Odometry
from modt.pipeline import Pipeline
from modt.sensor_fit.recognition import recognise
from modt.sinks.output import Sink
from modt.sources.pose_source import PoseSource
from modt.tracking.track_table import TrackTable
from modt.tracking.tracker import Tracker
from modt.types import Budget, Float32, Frame, FrameResult


class LiveSource(inputs.Described, Protocol):
    """A source that may know the profile of its sensor."""

    @property
    def profile(self) -> str | None:
        """Shipped profile of the sensor; None where it is not known."""


class LiveStages:
    """Stages of the profile that was asked for, else of that which the source names, corrected by the first sweep.

    Attributes:
        parts: of the present profile.
        odometry: of the poses.
        looking: thread that compares a sweep with the profile; None before the first one.
        misfits: number of times that sweeps were found to be of another sensor than before.

    Raises:
        MisuseError: an invalid request.
    """

    def __init__(self, request: inputs.Request, stream: LiveSource) -> None:
        self._request, self._stream = request, stream
        self._ledger = Ledger()
        self._seen = self._unlike = False  # the sensor; sweeps of another size
        self.misfits, self._watch = 0, SensorWatch()
        self.looking: Thread | None = None
        self._found: list[ChosenProfile] = []  # by the thread that looks again
        self.parts = self._made(self._chosen(None))
        self.odometry: PoseSource = inputs.odometry(request, stream, self.parts.config.odometry)
        self._good: tuple[TrackTable, int] = TrackTable.blank(), 0  # tracks and next id after the last good frame

    @property
    def period_s(self) -> float:
        """Of the sensor."""
        return self._stream.info.period_s

    @property
    def budget(self) -> Budget:
        """Of the profile."""
        return self.parts.budget

    def step(self, frame: Frame, budget: Budget, *, reduced: bool) -> FrameResult:
        """One frame; reduced: without what is far."""
        self._unlike |= self._watch.unlike(frame.points)
        if not self._seen:
            self._seen = True
            chosen = self._chosen(frame)
            if chosen.config == self.parts.config:
                self.parts = replace(self.parts, chosen=chosen)
            else:
                self._exchange(self._made(chosen))
        elif self._unlike and not (self.looking and self.looking.is_alive()):  # it takes longer than a frame
            self._unlike = False
            self.looking = Thread(target=self._look_again, args=(frame,), name="recognition", daemon=True)
            self.looking.start()
        elif self._found:
            self.misfits += 1
            self._exchange(self._made(self._found.pop()))
        frame = self.odometry.place(frame)
        if reduced:
            config = self.parts.config
            frame = replace(frame, points=within(frame.points, config.loop.range_share * config.sensor.max_range_m))
        pipeline = self.parts.pipeline
        result = pipeline.step(frame, budget)
        if isinstance(pipeline.tracker, Tracker) and isinstance(result.tracks, TrackTable):
            self._good = result.tracks, pipeline.tracker.next_id
        return result

    def run_sink(self, stage: str, sink: Sink, result: FrameResult) -> None:
        """Write a result, as a span of the ledger."""
        self._ledger.run(stage, sink.write, result)

    def close_frame(self, index: int) -> dict[str, Any]:
        """The ledger line of a frame."""
        return self._ledger.close_frame(index)

    def recover(self, *, anew: bool) -> None:
        """Hold the tracks of the last good frame; anew: in stages without a past, and no tracks."""
        tracks, next_id = self._good
        if anew:
            tracks = TrackTable.blank()
            pipeline = pipeline_of(self._request, self._stream, self.parts.config, self._ledger)
            self.parts = replace(self.parts, pipeline=pipeline)
        if isinstance(self.parts.pipeline.tracker, Tracker):
            self.parts.pipeline.tracker.restore(tracks, next_id)

    def reload(self) -> None:
        """Take the profile as it is on disk now; tracks go on.

        Raises:
            ModtError: it is not valid; nothing has changed.
        """
        chosen, seen = self._chosen(None), self.parts.chosen.recognition
        self._exchange(self._made(replace(chosen, config=seen.mounted(chosen.config), recognition=seen)))
        self._seen = bool(self._request.profile)  # else the next sweep says what differs

    def _look_again(self, frame: Frame) -> None:
        """Sweeps have changed: whether they still are of the sensor of the profile in use."""
        if recognise(frame.points, self.parts.config).differences:
            self._found.append(self._chosen(frame))

    def _chosen(self, first: Frame | None) -> ChosenProfile:
        return choose(self._request.profile, first, replace(self._stream.info, profile=self._stream.profile))

    def _made(self, chosen: ChosenProfile) -> Parts:
        pipeline = pipeline_of(self._request, self._stream, chosen.config, self._ledger)
        return Parts(self._request, chosen, pipeline)

    def _exchange(self, parts: Parts) -> None:
        continue_from(self.parts.pipeline, parts.pipeline)
        self.parts = parts
        host.release_freed_pages()


def continue_from(old: Pipeline, new: Pipeline) -> None:
    """Let stages go on with the tracks, and in the world, of others."""
    if isinstance(old.tracker, Tracker) and isinstance(new.tracker, Tracker):
        new.tracker.adopt(old.tracker)
    if isinstance(old.odometry, Odometry) and isinstance(new.odometry, Odometry):
        new.odometry.adopt(old.odometry)


def within(points: Float32, range_m: float) -> Float32:
    """The points (N, 4) within a range of the sensor."""
    return points[np.square(points[:, 0]) + np.square(points[:, 1]) <= range_m**2]
