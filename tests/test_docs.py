"""The documents speak of what is there."""

import importlib
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGES = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").glob("*.md"))]


def resolves(dotted: str) -> bool:
    """Whether a dotted name leads to a module, or to something inside one."""
    parts = dotted.split(".")
    for cut in range(len(parts), 0, -1):
        try:
            found = importlib.import_module(".".join(parts[:cut]))
        except ImportError:
            continue
        for name in parts[cut:]:
            if not hasattr(found, name):
                return False
            found = getattr(found, name)
        return True
    return False


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_names_of_code_exist(page):
    names = re.findall(r"`(modt\.[a-z_]\w*(?:\.\w+)*)(?:\(.*?\))?`", page.read_text())
    missing = [n for n in names if not n.endswith((".service", ".env")) and not resolves(n) and "/" not in n]
    assert [n for n in missing if not re.fullmatch(r"modt\.\w+/\d+", n)] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#]+?)(?:#[^)]*)?\)", page.read_text()):
        if not target.startswith("http"):
            assert (page.parent / target).exists(), f"{page.name}: {target}"


def test_the_way_in_names_the_steps_in_order():
    text = (ROOT / "docs" / "life-of-a-frame.md").read_text()
    steps = ["Segmenter.segment", "Tracker.follow", "Scheduler.select", "PointNet.classify", "KeyViews.fuse"]
    places = [text.index(step) for step in steps]
    assert places == sorted(places)
