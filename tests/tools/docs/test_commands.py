"""The generated page of the commands."""

from tools.docs.commands import DOCUMENT, document, page, parsers


def test_the_page_is_up_to_date():
    assert document() == DOCUMENT.read_text(encoding="utf-8")


def test_every_option_is_in_a_row_of_two_columns():
    rows = [line for line in page().splitlines() if line.startswith("| `")]
    assert len(rows) == sum(len(parser._actions) - 1 for _, parser in parsers())
    assert all(row.replace("\\|", "").count("|") == 3 for row in rows)
