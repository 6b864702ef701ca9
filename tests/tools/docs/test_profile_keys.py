"""The generated page and schema of the keys of a profile."""

from modt_desk.cli.profile_schema import keys, schema_text
from tools.docs.profile_keys import DOCUMENT, SCHEMA, document


def test_page_and_schema_are_up_to_date():
    assert document() == DOCUMENT.read_text(encoding="utf-8")
    assert schema_text() == SCHEMA.read_text(encoding="utf-8")


def test_every_key_has_a_meaning():
    assert [key.path for key in keys() if not key.facts["meaning"]] == []
