"""Installing and removing the service, below a root of its own."""

import os

import pytest

from modt.cli.main import main
from modt_commands.service import drop_ins
from tests.cli.commands import refusal

PREFIX = ("--prefix", "/opt/modt")
"""The folder where the tests run may be one that a service cannot see."""


def content(root):
    return {str(p.relative_to(root)): p.read_text() for p in sorted(root.rglob("*")) if p.is_file()}


def service(action, root, *arguments):
    assert main(["service", action, "--root", str(root), *(PREFIX if action == "install" else ()), *arguments]) == 0
    return content(root)


def test_installing_again_changes_nothing(tmp_path, capsys):
    first = service("install", tmp_path, "--with", "lan-sensor", "--source", "velodyne://0.0.0.0:2368")
    assert set(first) == {
        "etc/systemd/system/modt.service",
        "etc/systemd/system/modt.service.d/lan-sensor.conf",
        "etc/modt/modt.env",
    }
    assert "MODT_SOURCE=velodyne://0.0.0.0:2368\n" in first["etc/modt/modt.env"]
    capsys.readouterr()
    assert service("install", tmp_path, "--with", "lan-sensor") == first
    assert capsys.readouterr().out == "nothing to change\n"


def test_drop_ins_follow_what_is_asked_for_and_those_of_others_stay(tmp_path):
    service("install", tmp_path, "--with", "lan-sensor", "--with", "rapl")
    own = tmp_path / "etc/systemd/system/modt.service.d/own.conf"
    own.write_text("[Service]\nNice=1\n")
    service("install", tmp_path, "--with", "rapl")
    assert sorted(p.name for p in own.parent.iterdir()) == ["own.conf", "rapl.conf"]


def test_the_environment_of_the_user_is_kept(tmp_path):
    service("install", tmp_path)
    path = tmp_path / "etc/modt/modt.env"
    path.write_text("MODT_SOURCE=mine\n")
    service("install", tmp_path, "--source", "other")
    assert service("remove", tmp_path) == {"etc/modt/modt.env": "MODT_SOURCE=mine\n"}


def test_removing_leaves_nothing_and_can_be_repeated(tmp_path):
    service("install", tmp_path, *(word for name in drop_ins() for word in ("--with", name)))
    assert service("remove", tmp_path) == {}
    assert service("remove", tmp_path) == {}


def test_the_unit_starts_the_environment_that_is_given_and_names_no_file_of_another(tmp_path):
    unit = service("install", tmp_path, "--prefix", "/srv/modt")["etc/systemd/system/modt.service"]
    assert "ExecStart=/srv/modt/bin/modt run" in unit
    assert "/opt/modt" not in unit
    assert "Documentation=" not in unit


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_without_the_permission_the_remedy_is_root(tmp_path, capsys):
    tmp_path.chmod(0o500)
    assert main(["service", "install", "--root", str(tmp_path), *PREFIX]) == 1
    assert "run it as root" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "named"), [(("--prefix", "/home/me/modt/.venv"), "cannot see"), (("--with", "nothing"), "--with")]
)
def test_an_environment_that_the_service_cannot_see_and_an_unknown_drop_in_are_refused(
    options, named, tmp_path, capsys
):
    assert named in refusal(capsys, "service", "install", "--root", tmp_path, *options)
    assert content(tmp_path) == {}
