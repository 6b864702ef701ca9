"""The stages of a run. They are exchanged between two frames at a reload, or when the sensor has changed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from threading import Thread
from typing import TYPE_CHECKING, Any

import numpy as np

from modt import host, profile
from modt.app import assembly, inputs
from modt.app.chosen_profile import ChosenProfile, choose
from modt.app.trust_report import TrustReport
from modt.config import ProfileConfig
from modt.energy.ledger import Ledger
from modt.errors import MisuseError
from modt.pipeline import Pipeline
from modt.placement import Mount
from modt.poses.pose_source import PoseSource
from modt.sensor_fit.recognition import recognise
from modt.sources.stream import StreamInfo
from modt.trust.sample import REACH_SHARE
from modt.trust.visibility import VisibilityEstimate
from modt.trust.watch import POSES, Finding, TrustWatch
from modt.types import Budget, Frame, FrameResult, TrustLevel

if TYPE_CHECKING:
    from modt.app.joint_trust import JointWatch

DOUBTED_S = 0.5
"""Time for which given poses are doubted before it is reported [s]."""
RECOMPARED_S = 2.0
"""Time between two comparisons with the profiles while the present one is not that of the begin [s]."""
POSES_REMEDY = "check the odometry: its scale, units, frames, and whether it stands still"


class Stages:
    """Stages of the requested profile, or of the one that the source names, corrected by the first sweep.

    Args:
        request: the options of the user.
        info: properties of the source before its first frame.
        ledger: ledger of the run.
        live: whether the sensor may be exchanged meanwhile. That of a recording is the one of its first sweep.
        run_id: as in FrameResult.

    Attributes:
        chosen: the present profile.
        pipeline: its stages.
        odometry: source of the poses.
        trust: judges the results.
        source_findings: what is held against a live source, by the names of the checks.
        comparison: thread that compares a sweep with the profile; None before the first comparison.
        read: account of what was read, once the run has ended.
        misfits: number of times that sweeps were found to be of another sensor than before.

    Raises:
        MisuseError: an invalid request.
    """

    def __init__(
        self,
        request: inputs.Request,
        info: StreamInfo,
        ledger: Ledger,
        *,
        live: bool = False,
        run_id: str = "",
    ) -> None:
        self.request = request
        self.ledger = ledger
        self.run_id = run_id
        self._info = info
        self._live = live
        self._mode = assembly.MODES[request.mode]
        self._chosen_for: Frame | None = None  # sweep by which the present profile was chosen
        self.misfits = 0
        self.read: dict[str, Any] | None = None  # account of what was read, at the end
        self.comparison: Thread | None = None
        # Found by the thread `comparison`: the sweep and its profile, or why there is none
        self._found_by_thread: list[tuple[Frame | None, ChosenProfile] | Exception] = []
        self._failure: Exception | None = None  # of the last comparison with the profiles
        self._compared_s = 0.0  # time of the sweep that was last compared with the profiles
        self._continuity = assembly.Continuity()
        self._requested = profile.resolve(request.profile)
        self.chosen = self._choose(None)
        self._began_with: tuple[Frame | None, ChosenProfile] = None, self.chosen
        self.pipeline = self._new_pipeline(self.chosen.config)
        self.trust = TrustReport(self.chosen.config.sensor, _watch(self.chosen.config))
        self.source_findings: dict[str, Finding] = {}
        self.odometry: PoseSource = inputs.odometry(request, info, self.config.odometry)

    @property
    def info(self) -> StreamInfo:
        """Properties of the source with its poses."""
        return self.odometry.of_stream(self._info)

    @property
    def config(self) -> ProfileConfig:
        """The present profile."""
        return self.chosen.config

    @property
    def budget(self) -> Budget:
        """Budget of a frame by mode and profile."""
        return self._mode.budget(self.config)

    def choose_profile(self, first: Frame, named: str | None = None) -> None:
        """Use the profile that fits the first sweep; `named` is the profile that the messages of the sensor name.

        Raises:
            ModtError: a file of the installation or of the profile cannot be used. The profile stays in use, and
                `adapt` compares a later sweep.
        """
        self._info = replace(self._info, profile=named or self._info.profile)
        with self._remembering_failure():
            chosen = self._choose(first)
            if chosen.config == self.config:
                self.chosen = chosen
            else:
                self._use(chosen)
            self._chosen_for = first
            self._began_with = first, chosen

    def step(self, frame: Frame, budget: Budget, *, reduced: bool) -> FrameResult:
        """Process a frame, and judge how far its result can be believed.

        `reduced` leaves out points beyond REACH_SHARE of the range, where the trust counts no returns.
        """
        frame = self.odometry.place(frame)
        if reduced:
            frame = _within(frame, REACH_SHARE * self.config.sensor.max_range_m)
        result = self.pipeline.step(frame, budget)
        trust = self.trust.judge(result, self._findings())
        is_level = result.frame.R_level_sensor is None  # in a tilted sweep a dead beam is at no elevation
        self.pipeline.view.leave_out(self.trust.watch.dead_deg if is_level else ())
        return replace(result, run_id=self.run_id, trust=trust)

    def _findings(self) -> dict[str, Finding]:
        """Findings about the source, the profile and the given poses."""
        findings = dict(self.source_findings)
        recognition = self.chosen.recognition
        if self._failure is not None:
            cause = f"the sweeps cannot be compared with the profiles: {self._failure}"
            findings["profile"] = Finding(
                TrustLevel.DEGRADED, cause, "restore the files of modt, its profiles and models"
            )
        elif not self.chosen.fits:
            cause = f"the sweeps do not fit the profile {self.chosen.sensor}: {', '.join(recognition.differences)}"
            findings["profile"] = Finding(TrustLevel.DEGRADED, cause, "give the profile of this sensor")
        elif self.config.sensor != self._began_with[1].config.sensor:
            cause = f"the sweeps are of another sensor than at first: {', '.join(recognition.differences)}"
            findings["profile"] = Finding(TrustLevel.DEGRADED, cause, "reload, if the sensor was exchanged")
        doubted_s = self._continuity.odometry.pose_check.doubted_s if self._continuity.odometry else 0.0
        if doubted_s >= DOUBTED_S:
            cause = "what stands still moves by the given poses, which are left out: the sweeps tell the motion"
            findings[POSES] = Finding(TrustLevel.DEGRADED, cause, POSES_REMEDY)
        return findings

    def adapt(self, frame: Frame) -> None:
        """Adapt to a changed sensor between two frames. The comparison is slow, so a thread makes it.

        A sensor that was knocked or turned keeps its profile: one that fits the view from there would hide that.
        After an exchange sweeps are compared at intervals, as the exchange may be the effect of a fault that ends,
        and after a failure until a comparison succeeds.

        Raises:
            Exception: the comparison failed. The present profile stays in use.
        """
        watch = self.trust.watch
        runs = self.comparison is not None and self.comparison.is_alive()
        unsettled = self._failure is not None or self.chosen is not self._began_with[1]
        wanted = watch.compare_profiles or (unsettled and frame.time_s - self._compared_s >= RECOMPARED_S)
        if self._found_by_thread:
            with self._remembering_failure():
                self._follow(self._found_by_thread.pop())
        elif wanted and not watch.displaced and self._live and not runs:
            watch.compare_profiles = False
            self._compared_s = frame.time_s
            self.comparison = Thread(target=self._compare, args=(frame,), name="recognition", daemon=True)
            self.comparison.start()

    def recover(self, *, anew: bool) -> None:
        """Restore the tracks of the last good frame; with `anew` make new stages without tracks.

        Raises:
            ModtError: the model cannot be used, so the stages stay, without tracks.
        """
        if not anew:
            self._continuity.tracks.roll_back()
            return
        self._continuity.tracks.clear()
        continuity = assembly.Continuity(self._continuity.tracks)
        self.pipeline = self._new_pipeline(self.config, continuity)
        self._continuity = continuity

    def reload(self) -> None:
        """Use the profile as it is on disk now; the tracks are kept.

        Raises:
            Exception: it cannot be used; nothing has changed.
        """
        requested = profile.resolve(self.request.profile)
        chosen = choose(requested, self._chosen_for, self._info)
        if [each.name for each in chosen.config.sensors] != [each.name for each in self.config.sensors]:
            raise MisuseError("sensors", "are others than at the start", "start modt anew for other sensors")
        self._use(chosen)
        self._requested = requested
        self._began_with = self._chosen_for, chosen
        self._failure = None

    def facts(self, core: int | None, command: Sequence[str]) -> dict[str, Any]:
        """Content of run.yaml."""
        request = self.request
        info = self.info
        chosen = self.chosen
        return {
            "schema": "modt.run/1",
            "run": self.run_id or None,
            "command": list(command),
            "stream": {
                "name": info.name,
                "layout": info.layout,
                "path": str(request.path.resolve()) if request.path else None,
                "frames": info.n_frames,
                "poses": info.has_poses,
                "odometry": self.odometry.report()["source"],
                "notes": [*info.notes, *info.pose_notes],
                **({} if self.read is None else {"read": self.read}),
            },
            "mode": request.mode,
            "fov": request.fov,
            "core": core,
            "versions": host.versions(),
            "segmentation": self.pipeline.view.facts(),
            "model": self.pipeline.classifier.facts(),
            "host": host.description(),
            "recognition": {
                "used": chosen.sensor,
                "differences": list(chosen.recognition.differences),
                "nearest": chosen.recognition.nearest,
            },
            "profiles": list(chosen.names),
            "profile": profile.dump(chosen.config),
        }

    def _follow(self, found: tuple[Frame | None, ChosenProfile] | Exception) -> None:
        """Use what a comparison has found."""
        if isinstance(found, Exception):
            raise found
        sweep, chosen = found
        if chosen is self.chosen:
            return
        self._use(chosen)
        if self._chosen_for is None:  # no sweep before could be compared
            self._began_with = found
        else:
            self.misfits += 1
        self._chosen_for = sweep

    @contextmanager
    def _remembering_failure(self) -> Iterator[None]:
        """Remember that a comparison with the profiles failed, which is a reason until another one succeeds."""
        try:
            yield
        except Exception as error:
            self._failure = error
            raise
        self._failure = None

    def _compare(self, frame: Frame) -> None:
        """Choose a profile anew if a sweep has other beams than the present one, or fits it as none did before."""
        try:
            fits = recognise(frame.points, self.config).fits
            if self._failure is None and fits == self.chosen.fits:
                return
            began_with = self._began_with[1]
            compared = self._chosen_for is not None
            back = compared and began_with.fits and recognise(frame.points, began_with.config).fits
            self._found_by_thread.append(self._began_with if back else (frame, self._choose(frame)))
        except Exception as error:
            self._found_by_thread.append(error)

    def _choose(self, first: Frame | None) -> ChosenProfile:
        return choose(self._requested, first, self._info)

    def _new_pipeline(self, config: ProfileConfig, continuity: assembly.Continuity | None = None) -> Pipeline:
        mount = Mount.of(config.sensor.roll_deg, config.sensor.pitch_deg)
        fov = inputs.field_of_view(self.request, self._info, mount)
        return assembly.pipeline(self._mode, config, fov, self.ledger, continuity or self._continuity)

    def _use(self, chosen: ChosenProfile) -> None:
        """Exchange the stages for those of another profile; the tracks are kept.

        Raises:
            Exception: they cannot be made; nothing has changed.
        """
        self.pipeline = self._new_pipeline(chosen.config)
        if chosen.config.sensor != self.config.sensor and not self.trust.watch.displaced:
            self.trust.watch = _watch(chosen.config, self.trust.watch)
            self.trust.visibility = VisibilityEstimate(chosen.config.sensor)
        self.chosen = chosen
        host.release_freed_pages()


def _within(frame: Frame, range_m: float) -> Frame:
    """The frame, and each of its sweeps, without the points beyond a range."""
    x, y = frame.points[:, :2].T
    near = np.square(x) + np.square(y) <= range_m**2
    sweeps = tuple(sweep and _within(sweep, range_m) for sweep in frame.sweeps)
    delay_s = None if frame.delay_s is None else frame.delay_s[near]
    return replace(frame, points=frame.points[near], delay_s=delay_s, sweeps=sweeps)


def _watch(config: ProfileConfig, before: TrustWatch | JointWatch | None = None) -> TrustWatch | JointWatch:
    """The checks of the sensor of a profile, or of each of its sensors; one sensor keeps the verdict before."""
    if not config.sensors:
        watch = TrustWatch(config.sensor)
        if isinstance(before, TrustWatch):
            watch.adopt(before)
        return watch
    from modt.app.joint_trust import JointWatch

    return JointWatch([(mounted, assembly.sensor_profile(mounted).sensor) for mounted in config.sensors])
