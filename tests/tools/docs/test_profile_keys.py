"""The generated page and file of the keys of a profile."""

from modt import profile
from modt.config import ProfileConfig
from modt_desk.cli.profile_schema import keys, schema_text
from tools.docs.profile_keys import CONDITIONS, DOCUMENT, SCHEMA, WHOLE, document, whole


def test_the_page_is_up_to_date():
    assert document() == DOCUMENT.read_text(encoding="utf-8")


def test_the_file_of_all_keys_is_up_to_date_and_the_default_profile():
    text = WHOLE.read_text(encoding="utf-8")
    assert whole() == text
    assert profile.parse(text) == ProfileConfig()


def test_the_schema_is_up_to_date():
    assert schema_text() == SCHEMA.read_text(encoding="utf-8")


def test_every_key_has_a_meaning_and_every_condition_a_key():
    found = list(keys())
    assert [key.path for key in found if not key.facts["meaning"]] == []
    paths = {key.path for key in found}
    assert [p for p in CONDITIONS if p not in paths and not any(path.startswith(f"{p}.") for path in paths)] == []
