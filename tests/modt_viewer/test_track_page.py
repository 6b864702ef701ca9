"""The page of a track, on its class."""

import re
from html import unescape
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
    """Text of the page by frame, that of the tiles by name."""
    run = SimpleNamespace(
        facts={"stream": {"name": "x"}, "mode": "accurate"},
        numbers=[100 + k for k in range(len(history))],
        states=STATES,
        frames=[{}] * len(history),
    )
    text = track_page(run, [row(at, *entry) for at, entry in enumerate(history)], {})
    plain = unescape(re.sub(r"<[^>]+>", " ", text))
    frames = dict(re.findall(r"Frame (\d+)\s+(.*?)(?=\s+Frame|\s*$)", plain, re.DOTALL))
    tiles = {name: (value, note) for name, value, note in re.findall(
        r'<div class="tile"><small>(.*?)</small><b>(.*?)</b><small>(.*?)</small>', text)}  # fmt: skip
    return frames, tiles, plain


def test_each_change_of_standing_is_shown_with_its_probability():
    frames, _, _ = shown(HISTORY)
    assert "Reported as background 80.0 %" in frames["100"]
    assert "settled: car 90.0 %" in frames["101"]
    assert re.search(r"Reported as cyclist\W+45\.0 %", frames["102"])
    assert "The class is open" in frames["102"]
    assert "settled: cyclist 75.0 %" in frames["103"]
    assert "104" not in frames, "nothing changed"
    assert "car +0.5, pedestrian -0.2, cyclist +1.5" in frames["101"], "of the motion"


def test_a_class_is_settled_from_where_it_stays_to_the_end():
    _, tiles, _ = shown(HISTORY)
    assert tiles["settled from frame"][0] == "103"
    assert tiles["reported at the end"] == ("cyclist", "posterior cyclist 85.0 %")
    _, tiles, _ = shown(HISTORY[:3])
    assert tiles["settled from frame"][0] == "never"
