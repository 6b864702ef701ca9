"""Frames a second and latency of the slider of a page of `modt view`, in an installed Chromium."""

from __future__ import annotations

from pathlib import Path

from tools.browser import Tab, browser, find
from tools.options import parser

LATENCIES = """(async () => {
  const found = [];
  for (let k = 0; k < 40; k++) {
    const at = (k * 61 + 17) % run.frames.length, began = performance.now();
    slider.value = at;
    slider.dispatchEvent(new Event("input"));
    while (canvas.dataset.frame !== String(run.frames[at].frame)) await new Promise(requestAnimationFrame);
    found.push(performance.now() - began);
  }
  return found.sort((a, b) => a - b);
})()"""
RATE = """(async () => {
  const wanted = 4, seconds = 4;
  await go(0);
  speed.value = wanted;
  let drawn = 0, before = canvas.dataset.frame;
  const began = performance.now();
  play();
  while (performance.now() - began < 1000 * seconds && state.at < last) {
    await new Promise(requestAnimationFrame);
    drawn += canvas.dataset.frame !== before;
    before = canvas.dataset.frame;
  }
  return 1000 * drawn / (performance.now() - began);
})()"""
"""Frames of 10 Hz at 4 times their speed: 40 a second, if the page keeps up."""


def main() -> None:
    options = parser(__doc__)
    options.add_argument("page", type=Path, help="written by modt view")
    options.add_argument("--size", type=int, nargs=2, default=(1280, 800), metavar=("W", "H"), help="pixels")
    arguments = options.parse_args()
    path = find()
    if path is None:
        options.error("no Chromium is installed")
    with browser(path) as started:
        tab = Tab(started, arguments.page.resolve().as_uri(), *arguments.size, dark=False)
        tab.until("canvas.dataset.frame !== undefined")
        ms = tab.value(LATENCIES)
        rate = tab.value(RATE)
        size_MB, median_ms = arguments.page.stat().st_size / 1e6, ms[len(ms) // 2]
        print(f"{size_MB:.1f} MB; slider median {median_ms:.0f} ms, worst {ms[-1]:.0f} ms")
        print(f"{rate:.1f} frames a second of 40; failures: {tab.failures() or 'none'}")


if __name__ == "__main__":
    main()
