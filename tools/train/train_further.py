"""Train a model further: heaps, rows of scooters, and people in every posture (extra [train]).

    python -m tools.train.train_further MODEL.onnx --bare BARE.npz... HELD.npz --people PEOPLE.npz... HELD.npz
                         --riders RIDERS.npz... HELD.npz --worn WORN.npz... HELD.npz --streets STREETS.npz...
                         --crops CROPS.npz... [--keep-boxes] [--steps N]

Streets have no heaps, few scooters, and their people stand and walk. A network that has seen nothing else takes a
heap or a row of scooters for a car, and who sits or crouches for background. The network is trained on with six kinds
of crops beside one another: those of --bare are background, those of --people, --riders, --worn and --streets have
the labels of the simulator, and those of --crops, the data of the model, keep the posterior that the network gives
them. A share of these is changed as worn sensors would measure them, and keeps the posterior of the unchanged. So the
class frequencies that the posteriors assume hold on streets. Crops of that data that are as narrow and low as a
person are drawn oftener, half of them people: bins, plants, signs and posts of streets stay background, and who walks
there stays a person. The box classifier is trained alike, without augmentation: the box of a car of which a part is
cut off is the box of a heap. One that has learnt these sweeps before is kept by --keep-boxes: to learn them again
costs cars and people of real scans. The model is replaced, and its card gets a section with the false objects, the
people and the riders on the held data sets, on which nothing is trained.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import onnx
import torch
from numpy.random import Generator
from scipy.special import softmax

from modt.classes import CLASS_NAMES, N_CLASSES, ObjectClass
from modt.classification import box_classifier
from modt.classification.crops import Crops, canonical
from modt.types import Bool, Float64, Int
from modt_training.augment import augment, distance_m, subsample, worn
from modt_training.dataset import (
    BATCH_SIZE,
    CLUSTERED,
    SEED,
    Dataset,
    dataset_features,
    draw_batch,
    load,
    sampling_pools,
)
from modt_training.fine_tuning import (
    BOX_CROPS,
    BOX_STEPS,
    MAX_POINTS,
    POINTS,
    Boxes,
    Examples,
    Model,
    augmented,
    joined,
    kept_examples,
    one_hot,
    save_model,
    street_boxes,
    street_examples,
    take,
    train_boxes,
    train_network,
    unchanged,
)
from tools.options import make_torch_deterministic, parser

KEPT_SIZE = 640
"""Number of crops of the data of the model of a step, which keep their posterior."""
BARE_SIZE = 48
"""Number of bare crops of a step."""
BARE_BATCHES = 160
"""Batches of augmented bare crops."""
MIN_WORTH = 0.1
"""Least relative rate at which a bare crop is drawn; the greatest is 1, for what the model takes for an object."""
MIN_BARE_POINTS = 20
"""Least number of points of an augmented bare crop: fewer tell no heap from a part of a car."""
MAX_RANGE_M = 45.0
"""Greatest distance of an augmented bare crop, for the same reason."""
PEOPLE_SIZE = 208
"""Number of crops of people, and of things beside them, of a step: as many of the one as of the other."""
PEOPLE_BATCHES = 250
"""Batches of such crops, half of them augmented."""
PEOPLE_FREQUENCY = np.array([0.83, 0.005, 0.16, 0.005])
"""Frequency of the classes among proposals where people are met in all postures: greater than on streets."""
PEOPLE_BOX_FREQUENCY = np.array([0.91, 0.005, 0.08, 0.005])
"""The same for the box classifier: lower, since a box alone tells less."""
PEOPLE_SHARE = np.array([0.5, 0.001, 0.5, 0.001])
"""Share of the classes in the crops of people and things."""
MIN_PEOPLE_WORTH = 0.3
"""Least relative rate at which such a crop is drawn; the greatest is 1, for what the model is wrong about."""
MIN_PEOPLE_POINTS = 12
"""Least number of points of a person in such a crop: fewer do not tell a low posture from a thing."""
MIN_PEOPLE_HEIGHT_M = 0.12
"""Least height of a person in such a crop: what one beam sees of who lies is a kerb as well."""
MAX_PEOPLE_M = 18.0
"""Greatest distance of a person in such a crop, for the same reason."""
MIN_FRAGMENT_M = 0.5
"""Least height of a person in such a crop whose legs are hidden: less is a sign or a lamp as well."""
MAX_FOOT_M = 0.7
"""Height of the lowest point above ground from which the legs are hidden."""
MIN_THING_POINTS = 6
"""Least number of points of a thing in such a crop."""
MAX_THING_M = 50.0
"""Greatest distance of a thing in such a crop: far things of few points are things."""
NARROW_SIZE = 224
"""Number of narrow crops of the data of the model of a step, which keep their posterior."""
NARROW_BATCHES = 320
"""Batches of such crops, half of them augmented."""
MAX_NARROW_TOP_M = 2.0
"""Greatest height of their top above ground: that of a person."""
MAX_NARROW_M = 1.3
"""Greatest extent of their points along either axis."""
RIDER_SIZE = 192
"""Number of crops of roads with rows of two-wheelers of a step."""
RIDER_BATCHES = 200
"""Batches of such crops, half of them augmented."""
RIDER_SHARE = np.array([0.5, 0.12, 0.13, 0.25])
"""Share of the classes in such crops."""
RIDER_FREQUENCY = np.array([0.89, 0.07, 0.03, 0.01])
"""Frequency of the classes among proposals of such roads."""
MIN_RIDER_POINTS = 10
"""Least number of points of such a crop."""
WORN_SIZE = 96
"""Number of crops of worn sensors of a step, of simulated sweeps and of the data of the model, each."""
WORN_BATCHES = 240
"""Batches of such crops of the data of the model."""
BOX_WORN_SIZE = 160
"""Number of crops of worn sensors of a step of the box classifier."""
BOX_BARE_SIZE = 96
"""Number of bare crops of a step of the box classifier."""
BOX_PEOPLE_SIZE = 192
"""Number of crops of people and things of such a step."""
BOX_NARROW_SIZE = 256
"""Number of narrow crops of the data of the model of such a step."""
BOX_RIDER_SIZE = 128
"""Number of crops of roads with rows of two-wheelers of such a step."""
CYCLIST_SHIFT = 0.5
"""Subtracted from the box classifier's logit of a cyclist [nat]: one that has learnt blurred boxes gives too many."""
MIN_BOX_POINTS = 10
"""Least number of points of bare crops for the box classifier."""
CALLED = 0.5
"""Posterior from which a crop counts as called."""
SECTION = "## Trained further"
"""Heading of the section of the card."""


def bare_examples(model: Model, data: Dataset, rng: Generator) -> Examples:
    """Crops without an object, those oftener that the model takes for one."""
    worth = np.maximum(1.0 - model.posterior(data)[:, ObjectClass.BACKGROUND], MIN_WORTH)
    drawn = rng.choice(len(data), (BARE_BATCHES, BATCH_SIZE), p=worth / worth.sum())
    local, distance, _ = augmented(data, drawn, rng)
    rows = np.flatnonzero((distance < MAX_RANGE_M) & (local.count >= MIN_BARE_POINTS))
    background = np.tile(one_hot(np.array([ObjectClass.BACKGROUND])), (len(rows), 1))
    return Examples(take(local, rows), background, BARE_SIZE, np.zeros(N_CLASSES))


def people_examples(model: Model, data: Dataset, rng: Generator) -> Examples:
    """Crops of people and of things beside them, as many of each, those oftener that the model is wrong about."""
    rows = people_and_things(data)
    label = data.label[rows]
    worth = np.maximum(1.0 - model.posterior(data)[rows, label], MIN_PEOPLE_WORTH)
    is_person = label == ObjectClass.PEDESTRIAN
    worth /= np.where(is_person, worth[is_person].sum(), worth[~is_person].sum())
    drawn = rows[rng.choice(len(rows), (PEOPLE_BATCHES, BATCH_SIZE), p=worth / worth.sum())]
    changed, distance_of_changed, rows_of_changed = augmented(data, drawn[::2], rng)
    same, rows_of_same = unchanged(data, drawn[1::2], rng)
    local = joined([changed, same])
    distance = np.append(distance_of_changed, distance_m(data.take(rows_of_same)))
    label = data.label[np.append(rows_of_changed, rows_of_same)]
    kept = np.flatnonzero(_shows_posture(label, local, distance, np.zeros(len(label))))
    wanted = one_hot(label[kept])
    return Examples(take(local, kept), wanted, PEOPLE_SIZE, np.log(PEOPLE_SHARE / PEOPLE_FREQUENCY))


def _shows_posture(label: Int, crops: Crops, distance: Float64, ground_z_m: Float64) -> Bool:
    """(R,) crops that can tell a posture, by (R,) class, distance [m] and z of the ground beneath them [m]."""
    z = crops.xyz[:, 2]
    starts = crops.offsets[:-1]
    foot = np.minimum.reduceat(z, starts)
    height = np.maximum.reduceat(z, starts) - foot
    least = np.where(foot - ground_z_m > MAX_FOOT_M, MIN_FRAGMENT_M, MIN_PEOPLE_HEIGHT_M)
    person = (height >= least) & (crops.count >= MIN_PEOPLE_POINTS) & (distance < MAX_PEOPLE_M)
    thing = (crops.count >= MIN_THING_POINTS) & (distance < MAX_THING_M)
    return np.where(label == ObjectClass.PEDESTRIAN, person, thing)


def people_and_things(data: Dataset) -> Int:
    """Rows of whole people, and of what is clearly no part of one."""
    is_person = data.label == ObjectClass.PEDESTRIAN
    is_thing = (data.label == ObjectClass.BACKGROUND) & ~data.unknown & (data.majority == ObjectClass.BACKGROUND)
    return np.flatnonzero(data.trainable & (is_person | is_thing))


def narrow(data: Dataset) -> Int:
    """Rows of whole objects and known background as narrow and low as a person, of real scans if there are any."""
    xyz = data.crops.xyz
    starts = data.crops.offsets[:-1]
    extent = np.maximum.reduceat(xyz, starts) - np.minimum.reduceat(xyz, starts)
    top = np.maximum.reduceat(xyz[:, 2], starts) - data.sensors.ground_z_m
    fits = data.trainable & (top < MAX_NARROW_TOP_M) & (extent[:, :2].max(axis=1) < MAX_NARROW_M)
    of_real = fits & (data.variant <= CLUSTERED)
    return np.flatnonzero(of_real if of_real.any() else fits)


def narrow_examples(model: Model, data: Dataset, rng: Generator) -> Examples:
    """Narrow crops of the data of the model, half of them people, with the posteriors that the network gives them."""
    rows = narrow(data)
    is_person = data.label[rows] == ObjectClass.PEDESTRIAN
    share = 1.0 / np.where(is_person, is_person.sum(), (~is_person).sum())
    drawn = rng.choice(rows, (NARROW_BATCHES, BATCH_SIZE), p=share / share.sum())
    local = joined([augmented(data, drawn[::2], rng)[0], unchanged(data, drawn[1::2], rng)[0]])
    return Examples(local, model.network_posterior(local), NARROW_SIZE, np.zeros(N_CLASSES))


def narrow_boxes(model: Model, data: Dataset) -> Boxes:
    """Boxes of narrow crops of the data of the model, which keep the posterior of the box classifier."""
    feature = dataset_features(data, narrow(data))
    wanted = softmax(box_classifier.logits(model.boxes.layers, feature), axis=1)
    return Boxes.of(feature, wanted, BOX_NARROW_SIZE, np.zeros(N_CLASSES))


def _of_riders(riders: Dataset) -> Int:
    """Rows of whole objects and background of roads with rows of two-wheelers."""
    return np.flatnonzero(riders.trainable & (riders.crops.count >= MIN_RIDER_POINTS))


def _drawn_riders(riders: Dataset, n: int, rng: Generator) -> Int:
    """(n,) rows of such roads, classes by their shares."""
    rows = _of_riders(riders)
    share = (RIDER_SHARE / np.bincount(riders.label[rows], minlength=N_CLASSES))[riders.label[rows]]
    return rng.choice(rows, n, p=share / share.sum())


def rider_examples(riders: Dataset, rng: Generator) -> Examples:
    """Crops of roads with rows of two-wheelers: riders, people, cars, and background beside them."""
    drawn = _drawn_riders(riders, RIDER_BATCHES * BATCH_SIZE, rng).reshape(RIDER_BATCHES, BATCH_SIZE)
    changed, _, rows_of_changed = augmented(riders, drawn[::2], rng)
    same, rows_of_same = unchanged(riders, drawn[1::2], rng)
    label = riders.label[np.append(rows_of_changed, rows_of_same)]
    return Examples(joined([changed, same]), one_hot(label), RIDER_SIZE, np.log(RIDER_SHARE / RIDER_FREQUENCY))


def rider_boxes(riders: Dataset, rng: Generator) -> Boxes:
    """Boxes of such crops."""
    drawn = _drawn_riders(riders, BOX_CROPS, rng)
    wanted = one_hot(riders.label[drawn])
    return Boxes.of(dataset_features(riders, drawn), wanted, BOX_RIDER_SIZE, np.log(RIDER_SHARE / RIDER_FREQUENCY))


def worn_examples(model: Model, data: Dataset, rng: Generator) -> Examples:
    """Crops of the data of the model as worn sensors measure them, with the posterior of what sound ones measure."""
    pools = sampling_pools(data, np.arange(len(data)))
    sound: list[Crops] = []
    of_worn_sensors: list[Crops] = []
    for _ in range(WORN_BATCHES):
        rows = draw_batch(pools, rng)
        crops, sensors = augment(subsample(data.take(rows), MAX_POINTS, rng), data.sensors.take(rows), rng)
        for kept, part in ((sound, crops), (of_worn_sensors, worn(crops, sensors, rng))):
            kept.append(canonical(subsample(part, POINTS, rng), sensors.ground_z_m))
    return Examples(joined(of_worn_sensors), model.network_posterior(joined(sound)), WORN_SIZE, np.zeros(N_CLASSES))


def bare_boxes(bare: Dataset) -> Boxes:
    """Boxes without an object."""
    feature = dataset_features(bare, np.flatnonzero(bare.crops.count >= MIN_BOX_POINTS))
    background = one_hot(np.full(len(feature), ObjectClass.BACKGROUND))
    return Boxes.of(feature, background, BOX_BARE_SIZE, np.zeros(N_CLASSES))


def people_boxes(people: Dataset, rng: Generator) -> Boxes:
    """Boxes of people and of things beside them, as many of each."""
    rows = people_and_things(people)
    crops = people.take(rows)
    ground_z_m = people.sensors.ground_z_m[rows]
    rows = rows[_shows_posture(people.label[rows], crops, distance_m(crops), ground_z_m)]
    is_person = people.label[rows] == ObjectClass.PEDESTRIAN
    drawn = np.concatenate([rng.choice(rows[of_kind], BOX_CROPS) for of_kind in (is_person, ~is_person)])
    wanted = one_hot(people.label[drawn])
    shift = np.log(PEOPLE_SHARE / PEOPLE_BOX_FREQUENCY)
    return Boxes.of(dataset_features(people, drawn), wanted, BOX_PEOPLE_SIZE, shift)


def warier_of_cyclists(model: Model) -> Model:
    """The model whose box classifier asks more of a cyclist, by CYCLIST_SHIFT."""
    *hidden, (weight, bias) = model.boxes.layers
    shift = CYCLIST_SHIFT * one_hot(np.array(ObjectClass.CYCLIST)).astype(bias.dtype)
    return replace(model, boxes=replace(model.boxes, layers=[*hidden, (weight, bias - shift)]))


def false_objects(before: Model, after: Model, held: Dataset) -> list[str]:
    """Markdown of the false objects a sweep without any, by sensor."""
    posteriors = [model.posterior(held) for model in (before, after)]
    lines = [f"| sensor | sweeps | proposals | {' | '.join(CLASS_NAMES[1:])} |", "|---|---|---|---|---|---|"]
    for number, name in enumerate(held.sensor_names):
        rows = held.sensor == number
        sweeps = max(len(np.unique(held.drive[rows])), 1)
        cells = []
        for c in range(1, N_CLASSES):
            false = [(p[rows, c] > CALLED).sum() / sweeps for p in posteriors]
            cells.append(" / ".join(f"{f:.2f}" for f in false))
        lines.append(f"| {name} | {sweeps} | {rows.sum()} | {' | '.join(cells)} |")
    return lines


def people_called(before: Model, after: Model, held: Dataset) -> list[str]:
    """Markdown of the people called and the things called pedestrian among people in all postures, by sensor."""
    posteriors = [model.posterior(held)[:, ObjectClass.PEDESTRIAN] for model in (before, after)]
    clear = np.zeros(len(held), np.bool_)
    clear[people_and_things(held)] = True
    is_person = held.label == ObjectClass.PEDESTRIAN
    lines = ["| sensor | people | called [%] | things | called pedestrian [%] |", "|---|---|---|---|---|"]
    for number, name in enumerate(held.sensor_names):
        cells = []
        for rows in (clear & is_person, clear & ~is_person):
            of_sensor = rows & (held.sensor == number)
            shares = [100 * (p[of_sensor] > CALLED).mean() if of_sensor.any() else 0.0 for p in posteriors]
            cells += [str(of_sensor.sum()), " / ".join(f"{share:.1f}" for share in shares)]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return lines


def called_by_class(before: Model, after: Model, held: Dataset) -> list[str]:
    """Markdown of the objects called, and of the false ones, by class."""
    posteriors = [model.posterior(held) for model in (before, after)]
    rows = _of_riders(held)
    label = held.label[rows]
    lines = ["| class | objects | called [%] | background called so |", "|---|---|---|---|"]
    for c in range(1, N_CLASSES):
        called = [posterior[rows, c] > CALLED for posterior in posteriors]
        share = " / ".join(f"{100 * of_model[label == c].mean():.1f}" for of_model in called)
        false = " / ".join(str(of_model[label == 0].sum()) for of_model in called)
        lines.append(f"| {CLASS_NAMES[c]} | {(label == c).sum()} | {share} | {false} |")
    return lines


def narrow_called(before: Model, after: Model, data: Dataset) -> list[str]:
    """Markdown of the narrow background of the data of the model called pedestrian, by sensor."""
    rows = narrow(data)
    rows = rows[data.label[rows] == ObjectClass.BACKGROUND]
    lines = ["| sensor | background | called pedestrian | sum of the posteriors |", "|---|---|---|---|"]
    posteriors = [model.posterior(data)[rows, ObjectClass.PEDESTRIAN] for model in (before, after)]
    for number, name in enumerate(data.sensor_names):
        of_sensor = data.sensor[rows] == number
        if of_sensor.any():
            called = " / ".join(str((p[of_sensor] > CALLED).sum()) for p in posteriors)
            total = " / ".join(f"{p[of_sensor].sum():.0f}" for p in posteriors)
            lines.append(f"| {name} | {of_sensor.sum()} | {called} | {total} |")
    return lines


@dataclass(frozen=True)
class Held:
    """Data sets that nothing is trained on, for the card."""

    people: Dataset
    bare: Dataset
    riders: Dataset
    worn: Dataset


def section(before: Model, after: Model, held: Held, data: Dataset, facts: Sequence[str]) -> str:
    """Section of the card: how the model was trained, what it calls of held sweeps, and what it takes for objects."""
    people_sweeps = held.people.provenance[0]["people"]
    bare_sweeps = held.bare.provenance[0]["bare"]
    rider_sweeps = held.riders.provenance[0]["riders"]
    worn_worlds = held.worn.provenance[0]["worn"]
    lines = [
        SECTION,
        "",
        "With simulated sweeps (tools.train.train_further): before / after. The tables above are those before.",
        "A pedestrian is any person who does not ride a two-wheeler, in every posture, with all that they carry,",
        "wear or sit in.",
        "",
        *facts,
        "",
        "People who stand, bend, sit, kneel, crouch and lie, children and adults, with loads and aids, and things",
        f"beside them, in {people_sweeps} sweeps that nothing was trained on: share with a posterior above {CALLED}.",
        "",
        *people_called(before, after, held.people),
        "",
        "Background as narrow and low as a person among the data of the model, which were trained on.",
        "",
        *narrow_called(before, after, data),
        "",
        f"Roads with riders and with rows of parked scooters and bicycles, in {rider_sweeps} sweeps that nothing was",
        f"trained on: proposals with a posterior above {CALLED}.",
        "",
        *called_by_class(before, after, held.riders),
        "",
        "Streets, crossings and yards by sensors with dead beams, ranges that scatter by up to 12 cm, and tilted",
        f"mounts, in {worn_worlds} worlds that nothing was trained on: proposals with a posterior above {CALLED}.",
        "",
        *called_by_class(before, after, held.worn),
        "",
        "False objects a sweep among heaps, banks, boulders, rubble, stacks, bushes and young trees, in",
        f"{bare_sweeps} sweeps that nothing was trained on: proposals with an object posterior above {CALLED}.",
        "",
        *false_objects(before, after, held.bare),
        "",
    ]
    return "\n".join(lines)


def _sources(name: str, data: Dataset) -> str:
    """How many crops a data set has, and from which files."""
    return f"{len(data)} {name}, sha256 {', '.join(data.sha256)}"


def main() -> None:
    options = parser(__doc__)
    options.add_argument("model", type=Path)
    sweeps = {"bare": "without objects", "people": "of people", "riders": "of riders", "worn": "of worn sensors"}
    for kind, which in sweeps.items():
        shown = f"sweeps {which}; the last ones held out"
        options.add_argument(f"--{kind}", type=Path, nargs="+", required=True, help=shown)
    options.add_argument("--streets", type=Path, nargs="+", required=True, help="sweeps of simulated streets")
    options.add_argument("--crops", type=Path, nargs="+", required=True, help="data of the model")
    options.add_argument("--keep-boxes", action="store_true", help="leave the box classifier as it is")
    options.add_argument("--steps", type=int, default=1800, help="of the training (default: %(default)s)")
    args = options.parse_args()
    make_torch_deterministic()
    started = time.process_time()
    before = Model.of(onnx.load(str(args.model)))
    data = load(*args.crops)
    bare, people, riders, worn_sweeps = (
        load(*paths[:-1]) for paths in (args.bare, args.people, args.riders, args.worn)
    )
    held = Held(*(load(paths[-1]) for paths in (args.people, args.bare, args.riders, args.worn)))
    streets = load(*args.streets)
    rng = np.random.default_rng(SEED)
    kept = replace(kept_examples(before, data, rng), size=KEPT_SIZE)
    others = [
        bare_examples(before, bare, rng),
        people_examples(before, people, rng),
        street_examples(streets, rng),
        narrow_examples(before, data, rng),
        rider_examples(riders, rng),
        replace(street_examples(worn_sweeps, rng), size=WORN_SIZE),
        worn_examples(before, data, rng),
    ]
    after = train_network(before, kept, others, args.steps, SEED)
    if not args.keep_boxes:
        boxes = [
            bare_boxes(bare),
            people_boxes(people, rng),
            street_boxes(streets),
            narrow_boxes(before, data),
            rider_boxes(riders, rng),
            replace(street_boxes(worn_sweeps), size=BOX_WORN_SIZE),
        ]
        after = warier_of_cyclists(train_boxes(after, data, boxes, BOX_STEPS * args.steps, SEED))
    first_sha256 = hashlib.sha256(args.model.read_bytes()).hexdigest()
    sha256 = save_model(args.model, after)
    seconds = time.process_time() - started
    crops = [
        _sources("of sweeps without objects", bare),
        _sources("of sweeps of people", people),
        _sources("of roads with riders", riders),
        _sources("of worn sensors", worn_sweeps),
        _sources("of streets", streets),
        _sources("of the data of the model, which keep their posteriors", data),
    ]
    kept_boxes = ", the box classifier kept" if args.keep_boxes else ""
    facts = [
        f"- trained from the model of sha256 {first_sha256} on, seed {SEED}, {args.steps} steps, "
        f"torch {torch.__version__}, {seconds:.0f} s on one core{kept_boxes}",
        f"- crops: {'; '.join(crops)}",
    ]
    told = section(before, after, held, data, facts)
    card = args.model.with_suffix(".md")
    text = card.read_text(encoding="utf-8").partition(SECTION)[0].replace(first_sha256, sha256, 1)
    card.write_text(f"{text.rstrip()}\n\n{told}", encoding="utf-8")
    print(told)


if __name__ == "__main__":
    main()
