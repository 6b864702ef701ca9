"""The parts of a run that follow from its profile, and their record in run.yaml."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from modt import host, profile
from modt.app import assembly, inputs
from modt.app.chosen_profile import ChosenProfile
from modt.classes import CLASS_NAMES
from modt.config import ProfileConfig
from modt.energy.ledger import StageLedger
from modt.pipeline import Pipeline
from modt.placement import Mount
from modt.sources.pose_source import PoseSource
from modt.sources.stream import StreamInfo
from modt.types import Budget


@dataclass(frozen=True, slots=True)
class Parts:
    """A profile, and the stages made of it.

    Attributes:
        request: what was asked for.
        chosen: the profile used.
        pipeline: the stages.
    """

    request: inputs.Request
    chosen: ChosenProfile
    pipeline: Pipeline

    @property
    def config(self) -> ProfileConfig:
        """Of the stages."""
        return self.chosen.config

    @property
    def name(self) -> str:
        """Of the profiles."""
        return " + ".join(self.chosen.names)

    @property
    def budget(self) -> Budget:
        """Of a frame, by mode and profile."""
        return assembly.MODES[self.request.mode].budget(self.config)

    def facts(self, info: StreamInfo, odometry: PoseSource, core: int | None, command: list[str]) -> dict[str, Any]:
        """Content of run.yaml."""
        return {
            "schema": "modt.run/1",
            "command": command,
            "stream": {
                "name": info.name,
                "layout": info.layout,
                "path": str(self.request.path.resolve()) if self.request.path else None,
                "frames": info.n_frames,
                "poses": info.has_poses,
                "odometry": odometry.report()["source"],
                "notes": [*info.notes, *info.pose_notes],
            },
            "mode": self.request.mode,
            "fov": self.request.fov,
            "core": core,
            "versions": host.versions(),
            "segmentation": self.pipeline.segmenter.facts(),
            "model": self.pipeline.classifier.facts(),
            "host": host.description(),
            "recognition": {
                "used": self.chosen.sensor,
                "differences": list(self.chosen.recognition.differences),
                "nearest": self.chosen.recognition.nearest,
            },
            "profiles": list(self.chosen.names),
            "profile": profile.dump(self.config),
        }

    def class_frequency(self) -> dict[str, float]:
        """Of the proposals so far."""
        return dict(zip(CLASS_NAMES, self.pipeline.decision.frequency.tolist(), strict=True))


def pipeline_of(
    request: inputs.Request, stream: inputs.Described, config: ProfileConfig, ledger: StageLedger
) -> Pipeline:
    """The stages of a profile."""
    mount = Mount.of(config.sensor.roll_deg, config.sensor.pitch_deg)
    fov = inputs.field_of_view(request, stream, mount)
    return assembly.pipeline(assembly.MODES[request.mode], config, fov, ledger)
