"""The JSON Schema of a profile and the parser accept the same."""

import json
from types import NoneType

import pytest
import yaml

from modt import assets, profile
from modt.errors import MisuseError
from modt_commands.profile_schema import FILE, schema_text

SCHEMA = json.loads(schema_text())
SHIPPED = sorted(assets.folder("profiles").glob("*.yaml"))
KINDS = {"string": str, "integer": int, "number": int | float, "array": list, "object": dict, "null": NoneType}


def fits(value, schema):
    """Whether a value is valid, by the words of JSON Schema that the schema uses."""
    if "anyOf" in schema:
        return any(fits(value, one) for one in schema["anyOf"])
    if "enum" in schema:
        return value in schema["enum"]
    kinds = schema["type"] if isinstance(schema["type"], list) else [schema["type"]]
    if isinstance(value, bool) or not any(isinstance(value, KINDS[kind]) for kind in kinds):
        return False
    if isinstance(value, dict):
        known = schema["properties"]
        return value.keys() <= known.keys() and all(fits(v, known[k]) for k, v in value.items())
    if isinstance(value, list):
        bounds = schema.get("minItems", 0) <= len(value) <= schema.get("maxItems", 100)
        return bounds and all(fits(v, schema["items"]) for v in value)
    return isinstance(value, str) or value is None or schema["minimum"] <= value <= schema["maximum"]


@pytest.mark.parametrize("path", SHIPPED, ids=lambda p: p.stem)
def test_a_shipped_profile_names_the_schema_and_fits_it(path):
    text = path.read_text()
    assert text.startswith(f"# yaml-language-server: $schema={FILE}\n")
    assert fits(yaml.safe_load(text), SCHEMA)


@pytest.mark.parametrize(
    "text",
    [
        "sensor:\n",
        "extends: [vlp-16, raspberry-pi-5]",
        "extends: 3",
        "sensr: {}",
        "sensor: {height_m: null}",
        "sensor: {height_m: 9}",
        "sensor: {min_range_m: null}",
        "sensor: {elevations_deg: [1, 2]}",
        "sensor: {elevations_deg: [1]}",
        "sensor: {reflectance: vlp-16}",
        "segmentation: {min_points: 2.5}",
        "segmentation: {ground: {noise: 0.2}}",
        "energy: {board: 3}",
    ],
)
def test_the_schema_and_the_parser_agree(text):
    try:
        profile.parse(text)
        parsed = True
    except MisuseError:
        parsed = False
    assert fits(yaml.safe_load(text), SCHEMA) is parsed
