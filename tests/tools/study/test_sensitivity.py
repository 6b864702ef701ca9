"""The study of sensitivities reaches every chosen value, and its page shows the values that are shipped."""

import re

import numpy as np
import pytest

from modt.tuning import MethodTuning
from tools.study import sensitivity

CONSTANTS = list(sensitivity.constants(MethodTuning()))


def test_one_value_is_changed_and_no_other():
    one_of_each_part = {constant.path[:-1]: constant for constant in CONSTANTS}
    for constant in one_of_each_part.values():
        changed = sensitivity.with_value(MethodTuning(), constant.path, constant.changed(0.2))
        before_and_after = zip(CONSTANTS, sensitivity.constants(changed), strict=True)
        assert [a.name for a, b in before_and_after if a.value != b.value] == [constant.name]


def test_every_value_says_what_it_does():
    assert [constant.name for constant in CONSTANTS if not constant.meaning] == []


@pytest.mark.parametrize(
    ("difference", "text"), [([0, 0, 0], "0"), ([1, 1.1, 0.9], "**+1.0**"), ([-3, 3, 0.3], "+0.1")]
)
def test_a_difference_is_bold_where_its_interval_excludes_zero(difference, text):
    assert sensitivity.summary(np.array(difference, float)) == text


def test_what_the_page_says_is_kept_but_for_results_and_changed_values(monkeypatch):
    measures = sensitivity.MEASURES[:-1]
    first, second, third = (constant.name for constant in CONSTANTS[:3])
    known = {first: ["**+1.0**", "0", "+3", "0", "-0.1", "0"], second: ["refused"] * 6, third: ["**+2.0**"] * 6}
    page = sensitivity.tables(known, measures, 2)
    assert sensitivity.effects_on_page(page, len(measures)) == known
    assert [name for name in re.findall(r"`(\S+)`", page) if name in known] == [third, first, second]
    changed = sensitivity.with_value(MethodTuning(), CONSTANTS[1].path, 2 * CONSTANTS[1].value)
    monkeypatch.setattr(sensitivity.tuning, "MethodTuning", lambda: changed)
    assert set(sensitivity.effects_on_page(page, len(measures))) == {first, third}


def test_the_page_shows_the_shipped_values():
    stages = re.split(r"^### ", sensitivity.PAGE.read_text(), flags=re.MULTILINE)[2:]
    shown = {}
    for stage in stages:
        rows = re.findall(r"^\| `(\S+)` \| (\S+) \|", stage, re.MULTILINE)
        shown |= {f"{stage.split()[0].lower()}.{name}": value for name, value in rows}
    shipped = {constant.name: f"{constant.value:g}" for constant in CONSTANTS}
    assert shown
    assert shown == {name: shipped.get(name) for name in shown}
