"""Pages of `modt view` in a real browser."""

from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from tools.docs.browser import Browser, Tab, browser, find

RECORD = """
const drawn = [];
let image = null;
for (const name of ["fillText", "fill", "putImageData"]) {
  const real = CanvasRenderingContext2D.prototype[name];
  CanvasRenderingContext2D.prototype[name] = function (...given) {
    if (name === "putImageData") [image, drawn.length] = [given[0], 0];
    drawn.push([name, ...given]);
    return real.apply(this, given);
  };
}
"""
"""Script that records the drawing calls since the last points."""
SHOWN = """({
  frame: Number(canvas.dataset.frame),
  at: state.at,
  pixels: new Int32Array(image.data.buffer).reduce((n, value) => n + (value !== colours.paperPixel), 0),
  labels: drawn.filter(([name]) => name === "fillText").map(([, text]) => text),
  boxes: drawn.filter(([name]) => name === "fill").length,
  facts: [...element("answers").children, ...element("frame").children].map((child) => child.textContent).join(" "),
  story: element("story").innerText,
  legends: ["classes", "states", "stage-legend", "truth"].map((id) => element(id)?.textContent),
  wide: document.documentElement.scrollWidth > innerWidth,
  small: [...document.body.querySelectorAll("*")]
    .filter((e) => e.innerText && parseFloat(getComputedStyle(e).fontSize) < 12).map((e) => e.outerHTML),
})"""
DRAWN = "canvas.dataset.frame !== undefined"
LOADED = "document.readyState === 'complete' && location.protocol === 'file:'"
WIDE = "document.documentElement.scrollWidth > innerWidth"
SETTLED = """readSweep(state.at).then(
  () => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))
)"""
"""Promise that the frame shown, its points too, is drawn: the page has asked for both before."""


class Chromium:
    """The browser of all tests."""

    def __init__(self, started: Browser) -> None:
        self._browser = started

    def opened(self, page: Path, *actions: str, width: int = 1280, height: int = 800, dark: bool = False):
        """Contents of a page after actions: slide:K, key:NAME or hover:X,Y [m, sensor frame]."""
        with self.tab(page.resolve().as_uri(), width=width, height=height, dark=dark) as tab:
            for action in actions:
                act(tab, *action.split(":"))
                tab.value(SETTLED)
            return tab.value(SHOWN)

    @contextmanager
    def tab(self, url: str, *, width: int = 1280, height: int = 800, dark: bool = False, ready: str = DRAWN):
        """A page that has drawn a frame, and must have no failure when it is left."""
        with closing(Tab(self._browser, url, width, height, dark=dark, first=RECORD)) as tab:
            tab.until(ready)
            yield tab
            assert tab.failures() == []


def act(tab: Tab, kind: str, what: str) -> None:
    """Perform one action on a page."""
    if kind == "slide":
        tab.value(f"slider.value = {what}; slider.dispatchEvent(new Event('input'))")
        tab.until(f"state.at === {what} && canvas.dataset.frame === String(frames[{what}].frame)")
    elif kind == "key":
        tab.press(what)
    else:
        box = "canvas.getBoundingClientRect()"
        x, y = tab.value(f"(() => {{ const [x, y] = screen({what}); return [x + {box}.left, y + {box}.top] }})()")
        tab.point(x, y)


@pytest.fixture(scope="session")
def chromium():
    """A browser, where one is installed."""
    path = find()
    if path is None:
        pytest.skip("no Chromium is installed")
    with browser(path) as started:
        yield Chromium(started)
