"""Generated pages."""

import pytest

from modt_commands.profile_schema import keys, schema_text
from tools.docs import commands, profile_keys, state_tables


@pytest.mark.parametrize("page", [commands, profile_keys, state_tables], ids=lambda page: page.__name__)
def test_a_page_is_up_to_date(page):
    assert page.document() == page.DOCUMENT.read_text(encoding="utf-8")


def test_the_schema_is_up_to_date_and_every_key_has_a_meaning():
    assert schema_text() == profile_keys.SCHEMA.read_text(encoding="utf-8")
    assert [key.path for key in keys() if not key.facts["meaning"]] == []
