"""The film of the README."""

import pytest

from tools.docs import street
from tools.docs.browser import find


@pytest.mark.command
@pytest.mark.skipif(find() is None, reason="no Chromium is installed")
def test_the_film_has_each_frame_and_is_small(tmp_path, monkeypatch, capsys):
    image = pytest.importorskip("PIL.Image")
    film = tmp_path / "street.webp"
    monkeypatch.setattr(street, "FILM", film)
    monkeypatch.setattr(street, "FRAMES", range(2, 5))
    monkeypatch.setattr("sys.argv", ["street"])
    street.main()
    assert str(film) in capsys.readouterr().out
    with image.open(film) as made:
        assert (made.size, made.n_frames) == (street.SIZE, 3)
    with image.open(street.DOCS / "street.webp") as shipped:
        assert shipped.size == street.SIZE
        assert (street.DOCS / "street.webp").stat().st_size < 1e6
