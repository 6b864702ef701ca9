"""The page of a track, on its class."""

from types import SimpleNamespace

from modt.classes import CLASS_NAMES
from modt.viewer.track_rows import COLUMNS
from modt_viewer.track_page import track_page

STATES = ["unmatched", "tracked_classified", "tracked_unclassified"]
# posterior of background, car, pedestrian and cyclist in %, reported class, state, final
HISTORY = [
    ((80, 5, 5, 10), "background", 0, False),
    ((2, 90, 5, 3), "car", 1, True),
    ((10, 40, 5, 45), "cyclist", 2, False),
    ((3, 20, 2, 75), "cyclist", 1, True),
    ((3, 10, 2, 85), "cyclist", 1, True),
]


def row(at, posterior, name, state, final):
    values = dict.fromkeys(COLUMNS, 0.0) | {"id": 7.0, "at": float(at), "seen": 1.0, "points": 40.0}
    values |= {f"p_{c}": p / 100 for c, p in zip(CLASS_NAMES, posterior, strict=True)}
    return values | {
        "class": float(CLASS_NAMES.index(name)), "state": float(state), "final": float(final),
        "classified": float(at == 1), "motion_car": 0.5, "motion_cyclist": 1.5, "motion_pedestrian": -0.2,
    }  # fmt: skip


def shown(history):
    """Sentences of the page by frame, and its tiles by name."""
    run = SimpleNamespace(
        facts={"stream": {"name": "x"}, "mode": "accurate"},
        numbers=[100 + k for k in range(len(history))],
        states=STATES,
        frames=[{}] * len(history),
    )
    page = track_page(run, [row(at, *entry) for at, entry in enumerate(history)], {})
    track, *events = page.sections
    frames = {event.title: " ".join(event.lines) for event in events}
    return frames, {name: (value, note) for name, value, note in track.tiles}


def test_each_change_of_standing_is_shown_with_its_probability():
    frames, _ = shown(HISTORY)
    assert "Reported as background 80.0 %" in frames["Frame 100"]
    assert "settled: car 90.0 %" in frames["Frame 101"]
    assert "Reported as cyclist? 45.0 %" in frames["Frame 102"]
    assert "The class is open" in frames["Frame 102"]
    assert "settled: cyclist 75.0 %" in frames["Frame 103"]
    assert "Frame 104" not in frames, "nothing changed"
    assert "car +0.5, pedestrian -0.2, cyclist +1.5" in frames["Frame 101"], "of the motion"


def test_a_class_is_settled_from_where_it_stays_to_the_end():
    _, tiles = shown(HISTORY)
    assert tiles["settled from frame"][0] == "103"
    assert tiles["reported at the end"] == ("cyclist", "posterior cyclist 85.0 %")
    _, tiles = shown(HISTORY[:3])
    assert tiles["settled from frame"][0] == "never"
