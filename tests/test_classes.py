"""Rows of one's own in the table of classes."""

import json

import pytest

from modt.classes import CLASSES, ClassKind, read_rows
from modt.config import DecisionConfig, completed
from modt.errors import MisuseError

DOG = {"name": "dog", "kind": "other", "labels": ["Animal", "Dog"], "max_length_m": 1.5, "max_width_m": 0.8} | {
    "usual_m": [0.8, 0.3, 0.6],
    "spread_m": [0.2, 0.1, 0.1],
}


def rows_of(tmp_path, *rows):
    path = tmp_path / "classes.json"
    path.write_text(json.dumps(rows))
    return read_rows(path)


def test_a_row_needs_a_name_a_kind_labels_and_sizes_alone(tmp_path):
    (dog,) = rows_of(tmp_path, DOG)
    assert dog.name == "dog"
    assert dog.kind is ClassKind.OTHER
    assert dog.kitti == dog.labels == ("Animal", "Dog")
    assert not dog.person
    assert rows_of(tmp_path, DOG | {"kind": "rider"})[0].person


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"name": "Dog"}, "lower-case"),
        ({"name": "car"}, "taken"),
        ({"name": "other"}, "taken"),
        ({"kind": "animal"}, "other, vehicle, walker, rider"),
        ({"labels": []}, "labels"),
        ({"labels": "Dog"}, "labels"),
        ({"usual_m": [1.0, 2.0]}, "usual_m"),
        ({"spread_m": [0.0, 0.1, 0.1]}, "spread_m"),
        ({"semantic_kitti": [0.5]}, "semantic_kitti"),
        ({"max_length_m": True}, "max_length_m"),
        ({"colors": "red"}, "right keys"),
    ],
)
def test_a_wrong_row_is_one_line_that_names_it(tmp_path, change, words):
    with pytest.raises(MisuseError, match=words) as error:
        rows_of(tmp_path, DOG | change)
    assert "class 1" in str(error.value)


@pytest.mark.parametrize("text", ["", "{", "{}", "[]", "[1]", "[{}]"])
def test_what_is_no_table_is_refused(tmp_path, text):
    path = tmp_path / "classes.json"
    path.write_text(text)
    with pytest.raises(MisuseError):
        read_rows(path)


def test_one_name_stands_once(tmp_path):
    with pytest.raises(MisuseError, match="class 2"):
        rows_of(tmp_path, DOG, DOG)


def test_values_of_modts_own_classes_are_enough():
    cost = DecisionConfig.__dataclass_fields__["missed_cost"]
    metadata = {"most": len(CLASSES), "own": (2.5,)}
    with_one_class_more = type("", (), {"metadata": metadata})()
    assert completed(with_one_class_more, (1.0, 1.0, 1.0)) == (1.0, 1.0, 1.0, 2.5)
    assert completed(with_one_class_more, (1.0, 1.0, 1.0, 3.0)) == (1.0, 1.0, 1.0, 3.0)
    assert completed(cost, (1.0, 1.0, 1.0)) == (1.0, 1.0, 1.0)
