"""Labelled recordings of one's own to a model that has learnt them, with its card and a profile.

The model is a shipped one, trained further: crops of the recordings are learnt by their labels. Simulated crops serve
twice: all keep the posterior of the base model, and the trainable ones are also learnt by their labels. Every fold
leaves recordings out, and the card is of those.
"""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from shlex import quote
from typing import Any

import numpy as np
import onnx
import torch
from scipy.special import log_softmax

from modt import profile
from modt.classes import CLASS_NAMES, FILE, N_CLASSES, N_SHIPPED
from modt.classification import box_classifier
from modt.classification.pool import log_pool
from modt.model_file import ModelFile
from modt.types import Bool, Float64, Int
from modt_evaluation.class_score import precision_recall
from modt_simulation.sensors import SENSORS
from modt_training.crop_writer import CropWriter
from modt_training.dataset import (
    CLASS_SHARE,
    SEED,
    SYNTHETIC,
    Dataset,
    dataset_features,
    draw_batch,
    folds,
    load,
    sampling_pools,
)
from modt_training.export_pointnet import score_tables
from modt_training.fine_tuning import (
    BOX_CROPS,
    BOX_STEPS,
    KEPT_BATCHES,
    RARE,
    Boxes,
    Examples,
    Model,
    augmented,
    extended,
    extended_metadata,
    joined,
    kept_examples,
    layers_of,
    one_hot,
    save,
    save_model,
    street_boxes,
    street_examples,
    train_boxes,
    train_network,
    unchanged,
)
from modt_training.held_out import Validation
from modt_training.recordings import Progress, check_examples, open_recordings, write_crops
from modt_training.scores import by_sensor
from modt_training.simulated import simulated_scans

MOST_FOLDS = 3
"""Greatest number of folds."""
KEPT_SCENES = ("street", "crossing", "yard", "hall")
"""Scenes whose crops keep their posterior."""
KEPT_SEEDS = 48
"""Number of worlds of each."""
FIRST_SEED = 400_000
"""Seed of the first of them, apart from those of any other use."""
KEPT_TIMES_S = (0.0, 2.5)
"""Times of their sweeps."""
NEW_SIZE = 96
"""Crops of the recordings in a step of the network."""
NEW_BOX_SIZE = 192
"""Crops of the recordings in a step of the box classifier."""
NEW_BATCHES = 400
"""Batches of crops of the recordings, half of them augmented; augmentation costs more than a step."""
SMOOTHING = 0.02
"""Label smoothing: probability spread evenly over the classes."""
LEAST_SHARE = 0.01
"""Share in a batch that is assumed for a class without examples, so that false objects of it are unlearnt."""
FREQUENCY = (1e-4, 0.02)
"""Least and greatest frequency that is stated for a class of the user's own. More makes more of a street look like an
object: it is classified more often, and false cars are reported. The decision adapts it to what a stream shows."""
THRESHOLDS = (0.2, 0.8)
"""Least and greatest posterior from which a class of the user's own is reported."""


def write_kept(path: Path, sensor: str, seeds: int, progress: Progress) -> None:
    """Write the crops of simulated sweeps, by the sensor of a profile or else by every simulated one in turn."""
    sensors = (sensor,) if sensor in SENSORS else tuple(SENSORS)
    writer = CropWriter()
    for k, (seed, scene) in enumerate(product(range(FIRST_SEED, FIRST_SEED + seeds), KEPT_SCENES)):
        for scan in simulated_scans([scene], [seed], KEPT_TIMES_S, camera=False, sensors=[sensors[k % len(sensors)]]):
            writer.add(scan, SYNTHETIC)
        progress(f"simulated {scene}")
    writer.save(path, {"synthetic": seeds * len(KEPT_SCENES), "seed": FIRST_SEED})


def new_examples(model: Model, data: Dataset, rows: Int, batches: int, seed: int) -> tuple[Examples, Boxes]:
    """Examples for the network and for the box classifier, of rows of the crops of recordings."""
    rng = np.random.default_rng(seed)
    pools = sampling_pools(data, rows)
    share = np.array([s if len(of_class) else 0.0 for s, (of_class, _) in zip(CLASS_SHARE, pools, strict=True)])
    share /= share.sum()
    shift = np.log(share.clip(LEAST_SHARE)) - model.log_frequency
    drawn = [draw_batch(pools, rng, share=share) for _ in range(batches)]
    changed, _, rows_of_changed = augmented(data, drawn[::2], rng)
    same, rows_of_same = unchanged(data, drawn[1::2], rng)
    wanted = _smooth(data.label[np.append(rows_of_changed, rows_of_same)])
    of_box = draw_batch(pools, rng, BOX_CROPS, share)
    feature = dataset_features(data, rows)[np.searchsorted(rows, of_box)]  # rows are ascending
    boxes = Boxes.of(feature, _smooth(data.label[of_box]), NEW_BOX_SIZE, shift)
    return Examples(joined([changed, same]), wanted, NEW_SIZE, shift), boxes


def _smooth(label: Int) -> Float64:
    """(R, C) posteriors of labels (R,)."""
    return np.asarray((1.0 - SMOOTHING) * one_hot(label) + SMOOTHING / N_CLASSES)


@dataclass(frozen=True)
class Trainer:
    """Trains a model on the crops of recordings.

    Attributes:
        base: the model before, with an output for each class.
        data: crops of the recordings.
        kept_data: crops that keep their posterior.
        kept: examples drawn from these crops, half of them augmented.
        steps: steps of the network.
        progress: called after every step of the network.
    """

    base: Model
    data: Dataset
    kept_data: Dataset
    kept: Examples
    steps: int
    progress: Progress

    def trained(self, among: Bool, seed: int) -> Model:
        """The model after training on rows of a mask (R,)."""
        rows = np.flatnonzero(among & self.data.trainable)
        examples, boxes = new_examples(self.base, self.data, rows, min(NEW_BATCHES, self.steps), seed)
        streets = street_examples(self.kept_data, np.random.default_rng(seed))
        model = train_network(self.base, self.kept, [examples, streets], self.steps, seed, self.progress)
        return train_boxes(model, self.kept_data, [boxes, street_boxes(self.kept_data)], BOX_STEPS * self.steps, seed)

    def held_out(self, k: int) -> tuple[Validation, dict[str, Float64]]:
        """The crops to judge by, and (R, C) log posteriors of each by a model that has not seen its recording."""
        valid = Validation.of(self.data)
        fold = folds(self.data, k)
        out = {name: np.zeros((len(valid.rows), N_CLASSES)) for name in ("network", "box", POOL)}
        for i in range(k):
            model = self.trained(fold[self.data.drive] != i, SEED + 1 + i)
            in_fold = np.flatnonzero(fold[self.data.drive[valid.rows]] == i)
            for name, log_posterior in log_posteriors(model, self.data, valid.rows[in_fold]).items():
                out[name][in_fold] = log_posterior
        return valid, out


POOL = "pool"
"""Name of network and box together."""


def log_posteriors(model: Model, data: Dataset, rows: Int) -> dict[str, Float64]:
    """(R, C) log posteriors of rows of a data set by network, box, and both."""
    network = model.posterior_of_points(data, rows)
    box = log_softmax(box_classifier.logits(model.boxes.layers, dataset_features(data, rows)), axis=1)
    pool = log_pool(network, box, np.zeros_like(box), model.log_frequency, model.boxes.weights)
    return {"network": np.log(network.clip(1e-12)), "box": box, POOL: log_softmax(pool, axis=1)}


def frequencies(model: Model, data: Dataset) -> Model:
    """The model that assumes the frequency which the user's own classes have in the recordings."""
    valid = Validation.of(data)
    share = np.bincount(valid.label[valid.clear], minlength=N_CLASSES) / max(valid.clear.sum(), 1)
    own = share[N_SHIPPED:].clip(*FREQUENCY)
    others = np.exp(model.log_frequency[:N_SHIPPED])
    frequency = np.append(others / others.sum() * (1.0 - own.sum()), own)
    return replace(model, log_frequency=np.log(frequency))


def threshold(score: Float64, right: Bool) -> tuple[float, float, float]:
    """Posterior threshold of the greatest F1, clipped to THRESHOLDS; precision and recall before clipping.

    Args:
        score: (R,) log posterior of a class.
        right: (R,) whether a crop is of that class.
    """
    at, precision, recall = precision_recall(score, right, int(right.sum()))
    best = int(np.argmax(2 * precision * recall / np.maximum(precision + recall, 1e-9)))
    return float(np.clip(np.exp(at[best]), *THRESHOLDS)), float(precision[best]), float(recall[best])


@dataclass(frozen=True)
class Request:
    """Choice of what is trained.

    Attributes:
        recordings, labels: paths; no labels where they lie beside the recordings.
        profiles: names or files of the sensor's profiles.
        out: folder to write.
        name: of the model and the profile.
        steps: steps of the network; the box classifier takes BOX_STEPS times as many.
        kept_seeds: number of simulated worlds of each scene that keep their posterior.
    """

    recordings: Sequence[Path]
    labels: Sequence[Path]
    profiles: Sequence[str]
    out: Path
    name: str
    steps: int
    kept_seeds: int = KEPT_SEEDS

    @property
    def n_folds(self) -> int:
        """Number of folds."""
        return min(MOST_FOLDS, len(self.recordings))

    @property
    def n_pieces(self) -> int:
        """Number of calls of `progress`."""
        return len(self.recordings) + self.kept_seeds * len(KEPT_SCENES) + (self.n_folds + 1) * self.steps


def train(request: Request, progress: Progress) -> list[str]:
    """Train, and write model, network beside it, card, table of classes and profile; returns lines about them.

    Raises:
        MisuseError: recordings, labels, profile or model cannot be used, or examples are missing.
        OSError: a file cannot be written.
    """
    torch.set_num_threads(1)
    torch.use_deterministic_algorithms(True)
    started = time.process_time()
    resolved = profile.resolve(request.profiles)
    sensor = Path(resolved.sensor or profile.DEFAULT).stem
    recordings = open_recordings(request.recordings, request.labels)
    file = ModelFile.find(resolved.config.classification.model)
    base = Model.of(onnx.load_from_string(file.content))
    request.out.mkdir(parents=True, exist_ok=True)
    crops = request.out / "crops.npz"
    write_crops(crops, recordings, sensor, resolved.config, progress)
    data = load(crops)
    check_examples(data)
    kept = request.out / "kept.npz"
    write_kept(kept, sensor, request.kept_seeds, progress)
    kept_data = load(kept)
    base = frequencies(base, data)
    examples = kept_examples(base, kept_data, np.random.default_rng(SEED), min(KEPT_BATCHES, 2 * request.steps))
    trainer = Trainer(base, data, kept_data, examples, request.steps, progress)
    valid, held = trainer.held_out(request.n_folds)
    model = trainer.trained(np.ones(len(data), np.bool_), SEED)
    found = {c: threshold(held[POOL][valid.clear, c], valid.label[valid.clear] == c) for c in _present(valid)}
    path = request.out / f"{request.name}.onnx"
    sha256 = save_model(path, model)
    facts = [f"- trained on: {len(data)} crops of {len(recordings)} recordings ({sensor}), sha256 {data.sha256[0]}"]
    facts += [f"- posteriors kept on: {len(kept_data)} crops of simulated sweeps, sha256 {kept_data.sha256[0]}"]
    seconds = time.process_time() - started
    facts += [
        f"- training: modt train, {request.steps} steps, torch {torch.__version__}, {seconds:.0f} s of CPU time"
    ]
    scores = {name: by_sensor(posterior, valid, valid.clear) for name, posterior in held.items()}
    path.with_suffix(".md").write_text(card(request.name, sha256, file, facts, scores, found), encoding="utf-8")
    _write_beside(file, path)
    return [f"model and card: {path}", *_write_profile(request, path, found)]


def _present(valid: Validation) -> list[int]:
    """Classes of which there is a crop."""
    return np.unique(valid.label[valid.clear & (valid.label > 0)]).tolist()


def _write_beside(base: ModelFile, path: Path) -> None:
    """Write the network for what the view cuts, as it is beside the base. It learns no class of the user's own."""
    if (beside := base.beside("-near")) is not None:
        proto = onnx.load_from_string(beside.content)
        metadata = extended_metadata({entry.key: entry.value for entry in proto.metadata_props})
        save(path.with_stem(f"{path.stem}-near"), extended(layers_of(proto), np.log(RARE)), metadata)


def _write_profile(request: Request, path: Path, found: dict[int, tuple[float, float, float]]) -> list[str]:
    """Write the profile, and the table of classes with their thresholds; returns the lines of how to use them."""
    names = [name if not Path(name).is_file() else str(Path(name).resolve()) for name in request.profiles]
    settings = {"extends": names or [profile.DEFAULT], "classification": {"model": path.name}}
    made = path.with_suffix(".yaml")
    made.write_text(profile.to_yaml(settings), encoding="utf-8")
    lines = [f"next: modt replay DRIVE --profile {quote(str(made))}"]
    if FILE is not None:
        table = request.out / "classes.json"
        rows = json.loads(Path(FILE).read_text(encoding="utf-8"))
        for c, row in enumerate(rows, N_SHIPPED):
            if c in found:
                row["missed_cost"] = round(1.0 / found[c][0] - 1.0, 2)
        table.write_text(json.dumps(rows, indent=1), encoding="utf-8")
        lines = [f"classes: export MODT_CLASSES={table.resolve()}", *lines]
    return [f"profile: {made}", *lines]


def card(
    name: str,
    sha256: str,
    base: ModelFile,
    facts: Sequence[str],
    scores: dict[str, dict[str, Any]],
    found: dict[int, tuple[float, float, float]],
) -> str:
    """Model card in Markdown."""
    rows = [
        f"| {CLASS_NAMES[c]} | {at:.2f} | {100 * precision:.0f} | {100 * recall:.0f} |"
        for c, (at, precision, recall) in found.items()
    ]
    return "\n".join(
        [
            f"# {name}",
            "",
            f"{base.path.stem}, trained further on recordings of its user.",
            "",
            f"- sha256: {sha256}",
            f"- licence: that of {base.path.stem} (sha256 {base.sha256}), and that of the recordings",
            f"- classes: {', '.join(CLASS_NAMES)}",
            *facts,
            "",
            *score_tables(scores),
            "## Thresholds, out of fold",
            "",
            "The posterior of a proposal with the greatest F1, clipped to "
            f"{THRESHOLDS[0]:g} to {THRESHOLDS[1]:g}; precision and recall [%] before clipping.",
            "Those of the user's own classes stand in their table, as `missed_cost`.",
            "",
            "| class | posterior | precision | recall |",
            "|---|---|---|---|",
            *rows,
            "",
        ]
    )
