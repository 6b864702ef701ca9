"""Where labels find room."""

from modt_desk.viewer.canvas import TEXT_M
from modt_desk.viewer.labels import TRIES, Labels


class Canvas:
    def __init__(self):
        self.texts, self.lines = [], []

    def text(self, u, v, text, colour):
        self.texts.append((text, v))

    def line(self, uv, colour, width):
        self.lines.append(uv.tolist())


def test_a_label_that_moves_up_is_tied_to_where_it_belongs_and_the_last_is_left_out():
    canvas = Canvas()
    labels = Labels(canvas)
    for k in range(TRIES + 1):
        labels.write(3.0, 10.0, f"#{k}", "ink")
    assert canvas.texts == [(f"#{k}", 10.0 - k * TEXT_M) for k in range(TRIES)]
    assert canvas.lines == [[[3.0, 10.0], [3.0, 10.0 - k * TEXT_M]] for k in range(1, TRIES)]


def test_what_is_kept_free_stays_free():
    canvas = Canvas()
    labels = Labels(canvas)
    labels.keep_free(-1.0, 1.0, 0.0)
    labels.write(0.5, 0.3, "#1", "ink")
    labels.write(20.0, 0.3, "#2", "ink")
    assert [v for _, v in canvas.texts] == [0.3 - 2 * TEXT_M, 0.3]
