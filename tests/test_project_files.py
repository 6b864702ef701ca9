"""The files around the code agree with one another."""

from __future__ import annotations

import re
import sys
from itertools import chain
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement

import modt

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).resolve().parents[1]
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))

PROJECT_FILE = tomllib.loads((ROOT / "pyproject.toml").read_text())
PROJECT = PROJECT_FILE["project"]
FOLDERS, TEXTS = ("docs", "runtime", "tools", "systemd"), {".md", ".py", ".conf", ".service", ".yaml", ".txt"}
CLONE = "in a clone of modt"


def commands(target: str) -> set[str]:
    """Commands of the Makefile for a target and for the phony targets that it needs."""
    text = (ROOT / "Makefile").read_text()
    rule = re.search(rf"^{target}:(.*)\n((?:\t.*\n)*)", text, re.MULTILINE)
    assert rule, f"no target '{target}'"
    needed = [name for name in rule[1].split() if "$" not in name]
    return {line.strip() for line in rule[2].splitlines()}.union(*map(commands, needed))


def test_two_halves_have_every_test_once():
    text = (ROOT / "Makefile").read_text()
    registered = {line.partition(":")[0] for line in PROJECT_FILE["tool"]["pytest"]["ini_options"]["markers"]}
    assert set(re.findall(r"not (\w+)", text)) == registered
    folders = re.search(r"^ONE +:= (.*)$", text, re.MULTILINE)[1].split()
    assert all((ROOT / folder).is_dir() for folder in folders)
    for target, chosen in (("test", ""), ("quick", "$(QUICK) ")):
        assert commands(f"{target}-one") == {f"$(PYTEST) {chosen}$(ONE)"}
        assert commands(f"{target}-other") == {f"$(PYTEST) {chosen}tests $(ONE:%=--ignore=%)"}


def parsed(path: Path):
    return yaml.safe_load(path.read_text())


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda p: p.name)
def test_workflows_run_the_two_commands_from_the_lowest_python_on_and_may_only_read(path):
    lowest, workflow = PROJECT["requires-python"].removeprefix(">="), parsed(path)
    assert workflow["permissions"] == {"contents": "read"}
    for job in workflow["jobs"].values():
        pythons = [tuple(map(int, version.split("."))) for version in job["strategy"]["matrix"]["python"]]
        assert min(pythons) == tuple(map(int, lowest.split(".")))
        assert [step["run"] for step in job["steps"] if "run" in step] == ["make replay", "make test"]
        used = [step["uses"] for step in job["steps"] if "uses" in step]
        assert used
        assert [action for action in used if not re.fullmatch(r"[\w-]+/[\w-]+@v\d+", action)] == []


def test_hooks_run_what_make_test_runs_before_pytest():
    hooks = [hook for repo in parsed(ROOT / ".pre-commit-config.yaml")["repos"] for hook in repo["hooks"]]
    run = set().union(*(commands(hook["entry"].removeprefix("make ")) for hook in hooks))
    assert commands("test") - run == {"$(HALVES) test-one test-other"}
    assert run <= commands("test")


def test_the_lock_of_the_service_holds_each_dependency_within_its_bounds_and_with_hashes():
    lock = (ROOT / "systemd" / "requirements.txt").read_text()
    locked = re.findall(r"^(\S+)==(\S+).*\n    --hash=sha256:", lock, re.MULTILINE)
    assert len(locked) == len(re.findall(r"^\S+==", lock, re.MULTILINE))
    extras = re.match(r"# modt\[(.+)\]", lock)[1].split(",")
    wanted = [PROJECT["dependencies"], *(PROJECT["optional-dependencies"][extra] for extra in extras)]
    for requirement in map(Requirement, chain.from_iterable(wanted)):
        versions = [version for name, version in locked if name == requirement.name]
        assert versions, requirement
        assert all(version in requirement.specifier for version in versions)


def test_citation_and_changelog_name_this_version_and_the_paper():
    citation = parsed(ROOT / "CITATION.cff")
    heading = re.search(r"^## \[(.+)\] - ", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert heading[1] == citation["version"] == modt.__version__
    (paper,) = citation["references"]
    assert paper["title"] in " ".join((ROOT / "README.md").read_text().split())
    assert [author["family-names"] for author in paper["authors"]] == ["Li", "Guivant"]


def test_no_text_installs_modt_from_an_index_where_nobody_has_published_it():
    files = [p for p in chain(ROOT.glob("*.md"), *(ROOT.joinpath(f).rglob("*") for f in FOLDERS)) if p.is_file()]
    named = re.compile(r"pip install [^\n]*?(?<![\w/.-])modt(?![\w/.-])")
    found = {p for p in files if p.suffix in TEXTS and named.search(p.read_text(encoding="utf-8").replace(CLONE, ""))}
    assert found == set()


def test_the_remedy_for_a_missing_extra_names_one_that_exists():
    extras = PROJECT["optional-dependencies"]
    code = "".join(p.read_text() for f in ("runtime", "tools") for p in (ROOT / f).rglob("*.py"))
    assert set(re.findall(r"\binstall\([\"'](\w+)[\"']\)", code)) <= set(extras)
