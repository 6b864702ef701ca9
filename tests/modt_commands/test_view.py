"""`modt view` from the outside."""

import copy
import json
import re
import shutil
from base64 import b64decode
from io import BytesIO
from xml.etree import ElementTree

import numpy as np
import pytest

from modt.classes import CLASS_NAMES
from modt.geometry import wrap
from modt.publication import KIND_NAMES
from modt.viewer import theme
from modt_profiling.reporting.run_report import run_tree
from modt_profiling.reporting.run_sums import run_facts
from modt_viewer.recorded_run import RecordedRun
from tests.cli.commands import environment, here, modt, refusal, succeeded
from tests.recorded import drive_and_run
from tests.viewer.chromium import LOADED, SETTLED, WIDE
from tests.viewer.pages import Page

pytestmark = pytest.mark.command

FRAMES = 12


def lines_of(path):
    return [json.loads(line) for line in path.read_text().splitlines()]


def write_lines(path, records):
    path.write_text("".join(json.dumps(record) + "\n" for record in records))


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A run on the synthetic street, and the page of it, which opens at its first frame."""
    path = tmp_path_factory.mktemp("runs") / "run"
    assert here("replay", "--frames", f"0:{FRAMES}", "--quiet", "--out", path) == 0
    assert here("view", path, "--frame", 0, "--out", path / "view.html") == 0
    return path


@pytest.fixture(scope="module")
def records(run):
    return lines_of(run / "tracks.jsonl")


def test_a_call_costs_in_the_view_what_the_report_attributes_to_it(run):
    copy = shutil.copytree(run, run.with_name("metered"))
    lines = lines_of(copy / "ledger.jsonl")
    metered = [x | {"energy_J": 3 * x["energy_J"], "kind": "measured"} if "energy_J" in x else x for x in lines]
    write_lines(copy / "ledger.jsonl", metered)
    spent_mJ = sum(f["call_mJ"] * f["classifications"] for f in RecordedRun.read(copy).frames if "call_mJ" in f)
    reported = run_tree(copy)["parts_J"]["classification"].value * FRAMES
    assert spent_mJ == pytest.approx(1e3 * reported)


def test_the_page_holds_the_run(run, records):
    page = Page(run / "view.html")
    assert len(page.tracks) == sum(len(record["tracks"]) for record in records)
    for at, (record, frame) in enumerate(zip(records, page.run["frames"], strict=True)):
        assert all(frame[key] == record[key] for key in ("frame", "proposals", "classifications", "deferred"))
        rows = page.column("at") == at
        tracks = sorted(record["tracks"], key=lambda track: track["id"])
        assert page.column("id")[rows].tolist() == [track["id"] for track in tracks]
        states = [page.run["states"][state]["name"] for state in page.column("state")[rows]]
        assert states == [track["state"] for track in tracks]
        assert sorted(page.column("id")[rows & (page.column("classified") > 0)]) == sorted(record["classified"])
        assert len(record["classified"]) == record["classifications"]
        seen = [(track["box"]["x"], track["box"]["yaw"]) for track in tracks if track["box"]]
        drawn = np.stack([page.column("x") / 100, page.column("yaw") / 1000], axis=1)
        shift = drawn[rows & (page.column("seen") > 0)] - seen
        shift[:, 1] = wrap(shift[:, 1])  # pi and -pi are one yaw
        np.testing.assert_allclose(shift, 0.0, atol=0.0051)
    assert [len(cell) > 1000 for cell, _ in page.points] == [True] * FRAMES
    code = re.sub(r'<script type="text[^<]*', "", page.text)
    assert not re.search(r"https?:|<link|\bsrc=|\bimport\b|fetch\(", code), "it needs nothing from outside"


def test_the_page_opens_where_there_is_an_object(run, records, tmp_path):
    late = shutil.copytree(run, tmp_path / "late")
    unpublished = {"class": "background", "motion": "unknown"}
    background = [record | {"tracks": [t | unpublished for t in record["tracks"]]} for record in records]
    for first, options, begins in ((5, (), 5), (5, ("--frame", 3), 3), (len(records), (), 0)):
        lines = [*background[:first], *records[first:]]
        write_lines(late / "tracks.jsonl", lines)
        assert here("view", late, *options, "--out", late / "view.html") == 0
        assert Page(late / "view.html").run["start"] == begins


def test_the_page_opens_and_the_slider_moves(run, records, chromium):
    shown = chromium.opened(run / "view.html")
    assert (shown["frame"], shown["at"]) == (records[0]["frame"], 0)
    assert shown["pixels"] > 1000
    calls = run_facts(run)["profile"]["scheduler"]["calls_per_frame"]
    assert f"{records[0]['classifications']}, {records[0]['deferred']} budget {calls} calls" in shown["facts"]
    later = chromium.opened(run / "view.html", "slide:9")
    assert later["frame"] == records[9]["frame"]
    assert f"proposals {records[9]['proposals']} " in later["facts"]
    said = {f"#{t['id']} {t['uncertain'] or t['class']}" for t in records[9]["tracks"] if t["class"] != "background"}
    drawn = {label.rpartition(" ")[0].rpartition(" ")[0] for label in later["labels"] if label.endswith("%")}
    assert drawn <= said
    assert len(drawn) > len(said) / 2


@pytest.mark.parametrize(("width", "dark"), [(1280, False), (390, True)])
def test_everything_can_be_read(run, chromium, width, dark):
    shown = chromium.opened(run / "view.html", "slide:9", width=width, dark=dark)
    assert (shown["wide"], shown["small"]) == (False, [])
    assert shown["pixels"] > 1000


def test_stamps_from_1970_are_times_and_fit_a_narrow_page(run, records, tmp_path, chromium):
    dated = shutil.copytree(run, tmp_path / "dated")
    lines = [record | {"stamp_s": record["stamp_s"] + 1_400_000_000} for record in records]
    write_lines(dated / "tracks.jsonl", lines)
    pytest.importorskip("matplotlib")
    for more in ([], ["--frame", 9]):
        assert here("view", dated, *more) == 0
    with chromium.tab((dated / "view.html").as_uri(), width=390) as tab:
        assert tab.value("element('time').textContent").startswith("16:53:20.00, 1\xa0/\xa0")
        assert not tab.value(WIDE)
        right = "document.querySelector('footer').lastElementChild.getBoundingClientRect().right"
        assert tab.value(right) <= 390
        round_ = "Math.abs(canvas.width / canvas.clientWidth - canvas.height / canvas.clientHeight)"
        assert tab.value(round_) < 0.01
    assert "frame 9, 2014-05-13 16:53:20.90, mode" in (dated / "view-9.svg").read_text()


def test_pointing_at_a_track_tells_its_story(run, records, chromium):
    cars = [t for t in records[9]["tracks"] if t["class"] == "car" and t["box"]]
    track = min(cars, key=lambda t: abs(t["box"]["x"]))  # one that lies within the canvas
    shown = chromium.opened(run / "view.html", "slide:9", f"hover:{track['box']['x']},{track['box']['y']}")
    assert f"#{track['id']} car" in shown["story"]
    times = sum(track["id"] in record["classified"] for record in records)
    assert shown["story"].count("classified: ") == times > 0
    assert f"{track['state'].replace('_', ' ')}, {track['points']} points" in shown["story"]
    assert "mJ of classification (estimated)" in shown["story"]


def test_the_page_answers_first_what_is_around_and_what_moves(run, records, chromium):
    seen = [track for track in records[9]["tracks"] if track["box"]]
    movers = sum(track["motion"] == "moving" for track in seen)
    with chromium.tab((run / "view.html").as_uri()) as tab:
        tab.value(f"go(9).then(() => {SETTLED})")
        around = tab.value("element('classes').innerText")
        for name in CLASS_NAMES[1:]:
            assert f"{sum(track['class'] == name for track in seen)} {name}" in around
        listed = tab.value("[...element('moving').children].map((line) => line.innerText)")
        assert len(listed) == 7 if movers > 6 else len(listed) == movers > 0
        assert f"trust\n{records[9]['trust']['level']}" in tab.value("element('answers').innerText")
        tab.value("element('moving').querySelector('button').click()")
        number = re.search(r"#\d+", listed[0])[0]
        assert tab.value("element('story').innerText").startswith(f"{number} ")
        assert tab.value("element('states').checkVisibility()") is False
        tab.press("d")
        tab.until("state.details && element('states').checkVisibility()")


@pytest.mark.parametrize(("width", "height"), [(1440, 900), (390, 844)])
def test_in_perspective_boxes_stand_where_their_feet_are(run, chromium, width, height):
    size = {"width": width, "height": height}
    above = chromium.opened(run / "view.html", "slide:9", **size)
    with chromium.tab((run / "view.html").as_uri(), **size) as tab:
        tab.value(f"go(9).then(() => {SETTLED})")
        tab.value("element('deep').click()")
        tab.until("state.deep")
        tab.value(SETTLED)
        assert not tab.value(WIDE)
        assert tab.value("new Set(new Uint32Array(image.data.buffer)).size") > 4, "points have their heights"
        walls = tab.value("drawn.filter(([name]) => name === 'fill').length") - above["boxes"]
        assert walls == 5 * tab.value("rowsAt[9].filter((row) => row.class > 0).length")
        near = (
            "rowsAt[9].filter((row) => row.class && row.seen && row.x > 5).sort((a, b) => rangeOf(a) - rangeOf(b))[0]"
        )
        feet, head = tab.value(f"(() => {{ const row = {near}; return [outline(row), outline(row, row.h)] }})()")
        for foot, top in zip(feet, head, strict=True):
            assert top[1] < foot[1], "what is higher is higher on the screen"
            assert top[2] < foot[2], "and nearer to an eye above it"
        at = [sum(corner[axis] for corner in [*feet, *head]) / 8 for axis in range(2)]
        assert tab.value(f"trackAt({at[0]}, {at[1]}) === {near}.id")
        tab.value("drag(100, 40), zoom(2), draw()")
        tab.press("0")
        tab.press("v")
        tab.until("!state.deep")


def test_keys_step_and_hide(run, records, chromium):
    keys = ["key:ArrowRight", "key:ArrowRight", "key:p"]
    shown = chromium.opened(run / "view.html", *keys, dark=True)
    assert shown["at"] == 2
    assert shown["pixels"] == 0
    published = chromium.opened(run / "view.html", *keys, "key:b")["boxes"]
    assert published == 1 + len(records[2]["tracks"])
    assert chromium.opened(run / "view.html", "key:End")["at"] == FRAMES - 1


def test_a_frame_as_a_picture(run, records):
    image = pytest.importorskip("PIL.Image")
    pytest.importorskip("matplotlib")
    pictures = []
    for _ in range(2):
        assert here("view", run, "--frame", 9) == 0
        pictures.append((run / "view-9.svg").read_bytes())
    assert pictures[0] == pictures[1]
    root = ElementTree.fromstring(pictures[0])
    tag = "{http://www.w3.org/2000/svg}"
    groups = {group.get("id"): group for group in root.iter(f"{tag}g")}
    assert len(groups["tracks"].findall(f"{tag}path")) == len(records[9]["tracks"])
    assert len(groups["classified"].findall(f"{tag}path")) == records[9]["classifications"]
    text = " ".join(node.text or "" for node in root.iter(f"{tag}text"))
    assert f"{records[9]['classifications']} classified, {records[9]['deferred']} deferred" in text
    (points,) = root.iter(f"{tag}image")
    (encoded,) = (value for name, value in points.items() if name.endswith("href"))
    with image.open(BytesIO(b64decode(encoded.partition(",")[2]))) as pixels:
        drawn = sorted(n for n, _ in pixels.getcolors(1 << 20))
    assert drawn[-3] > 1000, "paper, ground, and points above it"


def test_what_is_left_out_can_be_coloured(run, tmp_path):
    image = pytest.importorskip("PIL.Image")
    pytest.importorskip("matplotlib")
    coloured = []
    structure = [int(theme.kinds()[-1]["colour"][k : k + 2], 16) for k in (1, 3, 5)]
    for more in ([], ["--left-out"]):
        assert here("view", run, "--frame", 9, *more, "--out", tmp_path / "frame.png") == 0
        with image.open(tmp_path / "frame.png") as picture:
            pixels = np.asarray(picture.convert("RGB")).reshape(-1, 3)
        coloured.append((pixels == structure).all(axis=1))
        assert here("view", run, *more, "--out", tmp_path / "view.html") == 0
        page = Page(tmp_path / "view.html")
        assert page.run["left_out"] == bool(more)
        assert page.run["kinds"] == theme.kinds()
    plain, left_out = coloured  # tracks may have the colour of structure too
    assert np.count_nonzero(left_out & ~plain) > 200


def test_the_key_k_colours_what_is_left_out(run, chromium):
    """The numbers of colours of the points, without reading the canvas back, of which the browser would warn."""
    with chromium.tab((run / "view.html").as_uri()) as tab:
        count = "new Set(new Uint32Array(image.data.buffer)).size"
        before = tab.value(count)
        tab.value("state.kinds = true; draw()")
        assert tab.value(count) > before


def test_a_doubtful_class_has_a_question_mark_in_pages_and_pictures(run, records, tmp_path, chromium):
    pytest.importorskip("matplotlib")
    doubtful = shutil.copytree(run, tmp_path / "doubtful")
    frame = copy.deepcopy(records[9])
    for track in frame["tracks"]:
        track["posterior"] = [0.6, *(0.4 * (track["class"] == name) for name in CLASS_NAMES[1:])]
    write_lines(doubtful / "tracks.jsonl", [frame])
    for more in ([], ["--frame", frame["frame"]]):
        succeeded("view", doubtful, *more, cwd=tmp_path)
    pictured = re.findall(r">(#\d+ [^<]+)<", (doubtful / f"view-{frame['frame']}.svg").read_text())
    opened = [label for label in chromium.opened(doubtful / "view.html")["labels"] if label.startswith("#")]
    for labels in (pictured, opened):
        drawn = [label.partition(" ")[2] for label in labels]
        # What moves or stands near without a class has a name and no posterior.
        of_a_class = [text for text in drawn if text.replace(" ", "_") not in KIND_NAMES]
        assert len(of_a_class) > 2
        assert {text.partition("?")[2] for text in of_a_class} == {" 40 %"}


def test_a_film_by_ffmpeg(run):
    if shutil.which("ffmpeg") is None:
        pytest.skip("ffmpeg is not installed")
    pytest.importorskip("matplotlib")
    assert here("view", run, "--animate") == 0
    assert (run / "view.mp4").read_bytes()[4:8] == b"ftyp"


def test_how_the_class_of_a_track_was_decided(run, records, chromium):
    numbers = [id_ for record in records for id_ in record["classified"]]
    id_ = max(set(numbers), key=numbers.count)
    assert here("view", run, "--track", id_) == 0
    seen = [next(t for t in record["tracks"] if t["id"] == id_) for record in records if id_ in record["classified"]]
    with chromium.tab((run / f"track-{id_}.html").as_uri(), width=390, ready=LOADED) as tab:
        assert not tab.value(WIDE)
        text = tab.value("document.body.innerText")
        pictures = "[...document.querySelectorAll('.picture svg')]"
        drawn = tab.value(f"{pictures}.map((svg) => svg.querySelectorAll('use').length)")
    assert f"classifications {len(seen)} " in " ".join(text.split()), text[:600]
    for track in seen:
        posterior = ", ".join(f"{c} {100 * p:.1f} %" for c, p in zip(CLASS_NAMES, track["posterior"], strict=True))
        assert f"Posterior: {posterior}" in text
    assert len(drawn) >= 2 * len(seen)
    assert sum(drawn) > 0


def test_a_program_that_a_picture_or_a_film_needs_is_named(run, tmp_path):
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / "matplotlib.py").write_text("raise ModuleNotFoundError('none', name='matplotlib')")
    without = {**environment(), "PYTHONPATH": f"{tmp_path / 'broken'}:{environment()['PYTHONPATH']}"}
    done = modt("view", run, "--frame", 9, cwd=tmp_path, env=without)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "needs matplotlib; pip install '.[view]'" in done.stderr
    pytest.importorskip("matplotlib")
    without = {**environment(), "PATH": str(tmp_path)}
    done = modt("view", run, "--out", tmp_path / "view.mp4", cwd=tmp_path, env=without)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "needs ffmpeg; install it, or give a name that ends with .gif" in done.stderr


@pytest.mark.slow
@pytest.mark.kitti
def test_a_drive_of_full_sweeps_fits_a_page(drive_0005, tmp_path, chromium):
    assert here("replay", drive_0005, "--frames", "0:50", "--quiet", "--out", tmp_path / "run") == 0
    assert here("view", tmp_path / "run") == 0
    page = tmp_path / "run" / "view.html"
    assert page.stat().st_size < 50 * 0.16e6
    assert [len(cell) > 40_000 for cell, _ in Page(page).points] == [True] * 50
    assert chromium.opened(page, "slide:49")["frame"] == 49


def test_without_its_source_a_run_has_no_points(run, tmp_path, chromium, caplog, capsys):
    moved = shutil.copytree(run, tmp_path / "moved")
    text = (moved / "run.yaml").read_text()
    (moved / "run.yaml").write_text(re.sub(r"path: null", "path: /nowhere/at/all", text, count=1))
    assert here("view", moved) == 0
    assert "without points: /nowhere/at/all" in capsys.readouterr().err + caplog.text
    page = Page(moved / "view.html")
    assert (page.points, page.run["points"]) == ([], None)
    shown = chromium.opened(moved / "view.html")
    assert (shown["pixels"], shown["at"]) == (0, page.run["start"])
    assert shown["boxes"] > 1


@pytest.fixture(scope="module")
def labelled(tmp_path_factory):
    """A run with the labels of its points, and the simulated drive that it is on."""
    return drive_and_run(tmp_path_factory.mktemp("labelled"), seconds=1.5, options=("--all-around",))


def viewed(run, *options):
    """Frames of the page of a run."""
    assert here("view", run, *options) == 0
    return Page(run / "view.html").run["frames"]


def outcomes(frames):
    return [o["outcome"] for frame in frames for o in frame["truth"]]


def test_truth_beside_the_source_is_marked_and_drawn(labelled, tmp_path, chromium):
    exact, drive = labelled
    assert here("replay", drive, "--profile", "vlp-16", "--quiet", "--out", tmp_path / "boxes") == 0
    frames = viewed(exact)
    by_boxes = viewed(tmp_path / "boxes")
    assert {"found", "missed"} <= set(outcomes(frames))
    assert np.mean([a == b for a, b in zip(outcomes(frames), outcomes(by_boxes), strict=True)]) > 0.95
    shown = chromium.opened(exact / "view.html", "slide:14")
    found, missed = (sum(o["outcome"] == name for o in frames[14]["truth"]) for name in ("found", "missed"))
    assert f"found, missed, false {found}, {missed}, {len(frames[14]['false'])}" in shown["facts"]
    assert "foundmissednot judgedfalse" in shown["legends"]


def test_truth_of_a_live_run_is_given_by_its_stamps_and_has_the_points(labelled, tmp_path, caplog, capsys):
    exact, drive = labelled
    live = shutil.copytree(exact, tmp_path / "live")
    shutil.rmtree(live / "labels")
    text = re.sub(r"path: .*\n(  .*\n)*", "path: null\n", (live / "run.yaml").read_text(), count=1)
    (live / "run.yaml").write_text(f"{text}service: true\n")
    lines = lines_of(live / "tracks.jsonl")
    moved = [line | {"frame": line["frame"] + 100, "stamp_s": line["stamp_s"] + 1e9} for line in lines]
    moved[-1]["stamp_s"] += 0.06  # farther than half a period from any scan
    write_lines(live / "tracks.jsonl", moved)
    viewed(live)
    assert "a live source cannot be read again" in capsys.readouterr().err + caplog.text
    by_stamp = viewed(live, "--truth", drive)
    by_number = viewed(exact)
    assert "truth" not in by_stamp.pop()
    by_number.pop()
    assert np.mean([a == b for a, b in zip(outcomes(by_stamp), outcomes(by_number), strict=True)]) > 0.95
    assert sum(len(cell) > 1000 for cell, _ in Page(live / "view.html").points) == len(by_stamp)


def test_misuse_is_one_line_with_the_remedy(run, tmp_path, capsys):
    another = tmp_path / "another"
    empty = tmp_path / "empty"
    another.mkdir()
    empty.mkdir()
    (another / "poses.txt").write_text("1 0 0 0 0 1 0 0 0 0 1 0\n" * 2)
    (another / "truth.csv").write_text("frame,track,label,x,y,z,l,w,h,yaw\n1,3,Car,9,1,0.5,4,2,1.5,0\n")
    late = shutil.copytree(run, tmp_path / "late")
    lines = (run / "tracks.jsonl").read_text().splitlines(keepends=True)
    (late / "tracks.jsonl").write_text("".join(lines[5:]))
    for arguments, message in (
        ((tmp_path,), "describes no run"),
        ((run, "--frame", 77), f"give one from 0 to {FRAMES - 1}"),
        ((run, "--track", 10**8), "is not recorded"),
        ((run, "--out", "view.jpg"), "give a name that ends with .html, .svg, .png, .gif, .mp4"),
        ((run, "--truth", empty), "holds no labels"),
        ((late, "--truth", another), "none of its frames is in the truth"),
    ):
        assert message in refusal(capsys, "view", *arguments)
