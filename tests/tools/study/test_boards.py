"""Estimates of CPU time on boards."""

import pytest

from tools.study.boards import BOARDS, Work, rating_of, table

PRINTED = """
Avr:       711    25   3041    751  |      11690    28   3598   1021
Tot:              27   3319    886
"""


def test_the_rating_is_that_of_full_usage():
    assert rating_of(PRINTED) == 3319
    with pytest.raises(ValueError, match="no line Tot"):
        rating_of(PRINTED.replace("Tot", "Sum"))


def test_times_are_scaled_by_the_ratings():
    *_, row = table([Work("os1-64", "accurate", 65536.4, 120.0, 3.25, 6.0)], 4 * 1752).splitlines()
    cells = [cell.strip() for cell in row.strip("|").split("|")]
    assert cells[:5] == ["os1-64, accurate", "65,536", "120", "3.2", "6.0 ms"]
    assert cells[5] == "24 ms"
    assert len(cells) == 5 + len(BOARDS)
