"""Damaged recordings, some of each form; `python -m tools.damage` tries hundreds."""

import pytest

from tests.fuzz.damage import WRITERS, trial


@pytest.mark.parametrize("seed", [*range(12), 1576784849, 2103851515])
@pytest.mark.parametrize("form", WRITERS)
def test_a_damaged_recording_gives_what_others_read_and_an_account_of_the_rest(tmp_path, form, seed):
    assert not trial(tmp_path, form, seed).broken
