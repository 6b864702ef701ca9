"""The examples, commands and links of the documents work, and every page can be reached."""

import dataclasses
import pkgutil
import re
from pathlib import Path

import numpy as np
import pytest
import yaml

from modt.classes import CLASS_NAMES
from modt.reporting.summary import Summary
from modt.sinks.topics import TopicOptions, topics
from modt_evaluation.box_score import BoxScore
from modt_evaluation.class_score import ClassScore
from modt_evaluation.evaluation import Evaluation, RangeScore, SegmentationScore
from modt_evaluation.reaction import Reaction
from modt_evaluation.track_score import TrackScore
from modt_simulation.synthetic_stream import SyntheticStream
from tests import results

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
PAGES = [*sorted(ROOT.glob("*.md")), *sorted(DOCS.glob("*.md"))]


def exists(dotted: str) -> bool:
    """Whether a dotted name leads to a module, or to something inside one."""
    try:
        pkgutil.resolve_name(dotted)
    except (ImportError, AttributeError):
        return False
    return True


def links(page: Path) -> set[Path]:
    """Files that a page links to."""
    targets = re.findall(r"\]\(([^)#]+?)(?:#[^)]*)?\)", page.read_text())
    return {(page.parent / target).resolve() for target in targets if not target.startswith("http")}


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_names_of_code_exist(page):
    names = re.findall(r"`((?:modt|modt_[a-z]+|tools)\.[a-z_]\w*(?:\.\w+)*)(?:\(.*?\))?`", page.read_text())
    commands = re.findall(r"python -m (tools\.[\w.]+)", page.read_text())
    of_code = [name for name in (*names, *commands) if not re.search(r"\.(service|env)$", name)]
    assert [name for name in of_code if not exists(name)] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_links_lead_to_files_and_their_headings(page):
    assert [str(target) for target in links(page) if not target.exists()] == []
    for target, anchor in re.findall(r"\]\(([^)#]*)#([^)]+)\)", page.read_text()):
        headings = re.findall(r"^#+ (.*)$", (page.parent / target if target else page).read_text(), re.MULTILINE)
        assert anchor in {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_every_page_is_linked_from_the_readme_or_another_page():
    linked = set.union(*(links(page) - {page} for page in PAGES))
    assert [page.name for page in (*DOCS.glob("*.md"), ROOT / "CONTRIBUTING.md") if page not in linked] == []


def test_the_examples_of_the_library_run(capsys, tmp_path, monkeypatch):
    tracks, costmap = re.findall(r"```python\n(.*?)```", (DOCS / "library.md").read_text(), re.DOTALL)
    frames = list(SyntheticStream("street", "vlp-16", 0.5, seed=3))
    scans = tmp_path / "DRIVE" / "velodyne_points" / "data"
    scans.mkdir(parents=True)
    for number, frame in enumerate(frames):
        frame.points.tofile(scans / f"{number:010}.bin")
    monkeypatch.chdir(tmp_path)
    exec(tracks, {})
    assert {line.split()[1] for line in capsys.readouterr().out.splitlines()} & set(CLASS_NAMES)
    variables = {}
    exec(costmap, variables)
    counts = dict(zip(*np.unique(variables["costmap"], return_counts=True), strict=True))
    assert min(counts[cost] for cost in (-1, 0, 100)) > 100


def test_the_costmap_of_nav2_reads_topics_of_modt_and_drops_no_point_by_its_default_heights():
    (text,) = re.findall(r"```yaml\n(.*?)```", (DOCS / "nav2.md").read_text(), re.DOTALL)
    costmap = yaml.safe_load(text)["local_costmap"]["local_costmap"]["ros__parameters"]
    assert all(costmap[name]["plugin"].startswith("nav2_costmap_2d::") for name in costmap["plugins"])
    layer = costmap["voxel_layer"]
    sources = {name: layer[name] for name in layer["observation_sources"].split()}
    assert {source["topic"] for source in sources.values()} == {"/modt/obstacles", "/modt/ground"}
    published = {topic.name: topic.type for topic in topics(TopicOptions(obstacles=True))}
    for source in sources.values():
        assert published[source["topic"]].endswith(f"/{source['data_type']}")
        assert source["min_obstacle_height"] < 0 < source["max_obstacle_height"]
    assert [source["marking"] for source in sources.values()] == [True, False]
    assert layer["z_voxels"] <= 16
    assert layer["origin_z"] + layer["z_voxels"] * layer["z_resolution"] >= layer["max_obstacle_height"] - 1e-9


def test_the_formats_name_every_field():
    record = results.frame_record(results.result(0, [5], {0: 0}))
    scores = (Evaluation, RangeScore, SegmentationScore, ClassScore, TrackScore, BoxScore, Reaction)
    fields = {f.name for score in scores for f in dataclasses.fields(score)}
    fields |= record.keys() | record["tracks"][0].keys() | Summary().result().keys()
    text = (DOCS / "formats.md").read_text()
    assert [name for name in sorted(fields - {"schema"}) if f"`{name}`" not in text] == []
