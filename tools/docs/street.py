"""Make docs/street.webp, the film of README.md: `modt replay` on its built-in street, in perspective.

    python -m tools.docs.street

It needs Chromium, and takes a minute of CPU time. The film is made of the page that `modt view` writes.
"""

from __future__ import annotations

import io
from base64 import b64decode
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

from modt.cli.main import main as modt
from tools.docs.browser import Tab, browser, find
from tools.docs.sections import DOCS
from tools.options import parser

FILM = DOCS / "street.webp"
SIZE = (840, 400)
"""Width and height [pixel]."""
FRAMES = range(6, 36)
"""Frames of the film, after tracks have begun."""
PERIOD_MS = 100
QUALITY = 20
"""Quality of the compression, up to 100."""
BARE = "header, aside, footer { display: none !important } #stage { position: fixed !important; inset: 0 }"
"""Style that leaves the scene alone."""


def pictures(page: Path) -> Iterator[Image.Image]:
    """The scene at each of FRAMES.

    Raises:
        SystemExit: Chromium is not installed.
    """
    path = find()
    if path is None:
        raise SystemExit("Chromium is not installed")
    with browser(path) as started, closing(Tab(started, page.as_uri(), *SIZE, dark=True)) as tab:
        tab.until("canvas.dataset.frame !== undefined")
        tab.value(
            f"document.head.append(Object.assign(document.createElement('style'), {{ textContent: '{BARE}' }}))"
        )
        tab.until(f"canvas.clientHeight === {SIZE[1]}")
        tab.value("fit(), reset(), deepen()")
        for frame in FRAMES:
            tab.value(f"go({frame})")
            tab.until(f"canvas.dataset.frame === '{frame}'")
            yield Image.open(io.BytesIO(b64decode(tab.call("Page.captureScreenshot")["data"]))).convert("RGB")


def main() -> None:
    parser(__doc__).parse_args()
    with TemporaryDirectory() as folder:
        run = Path(folder) / "run"
        modt(["replay", "--frames", f"0:{FRAMES.stop}", "--quiet", "--core", "none", "--out", str(run)])
        modt(["view", str(run)])
        first, *others = pictures(run / "view.html")
    first.save(FILM, save_all=True, append_images=others, duration=PERIOD_MS, loop=0, quality=QUALITY, method=6)
    print(f"{FILM} ({FILM.stat().st_size / 1e3:.0f} kB)")


if __name__ == "__main__":
    main()
