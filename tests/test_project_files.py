"""The files around the code agree with one another."""

from __future__ import annotations

import re
import sys
from itertools import chain
from pathlib import Path

import yaml
from packaging.requirements import Requirement

import modt

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).resolve().parents[1]

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


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


def test_citation_and_changelog_name_this_version():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    heading = re.search(r"^## \[(.+)\] - ", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert heading[1] == citation["version"] == modt.__version__


def test_the_remedy_for_a_missing_extra_names_one_that_exists():
    extras = PROJECT["optional-dependencies"]
    code = "".join(p.read_text() for f in ("runtime", "tools") for p in (ROOT / f).rglob("*.py"))
    assert set(re.findall(r"\binstall\([\"'](\w+)[\"']\)", code)) <= set(extras)
