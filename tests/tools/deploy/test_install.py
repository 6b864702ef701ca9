"""Installing and removing the service, below a root of its own."""

import pytest

from tools.deploy.install import DROP_INS, main


def content(root):
    return {str(p.relative_to(root)): p.read_text() for p in sorted(root.rglob("*")) if p.is_file()}


def install(root, *arguments):
    main(["--root", str(root), *arguments])
    return content(root)


def test_installing_again_changes_nothing(tmp_path, capsys):
    first = install(tmp_path, "--with", "lan-sensor", "--source", "velodyne://0.0.0.0:2368")
    assert set(first) == {
        "etc/systemd/system/modt.service",
        "etc/systemd/system/modt.service.d/lan-sensor.conf",
        "etc/modt/modt.env",
    }
    assert "MODT_SOURCE=velodyne://0.0.0.0:2368\n" in first["etc/modt/modt.env"]
    capsys.readouterr()
    assert install(tmp_path, "--with", "lan-sensor") == first
    assert capsys.readouterr().out == "nothing to change\n"


def test_drop_ins_follow_what_is_asked_for_and_those_of_others_stay(tmp_path):
    install(tmp_path, "--with", "lan-sensor", "--with", "rapl")
    own = tmp_path / "etc/systemd/system/modt.service.d/own.conf"
    own.write_text("[Service]\nNice=1\n")
    install(tmp_path, "--with", "rapl")
    assert sorted(p.name for p in own.parent.iterdir()) == ["own.conf", "rapl.conf"]


def test_the_environment_of_the_user_is_kept(tmp_path):
    install(tmp_path)
    path = tmp_path / "etc/modt/modt.env"
    path.write_text("MODT_SOURCE=mine\n")
    install(tmp_path, "--source", "other")
    install(tmp_path, "--remove")
    assert content(tmp_path) == {"etc/modt/modt.env": "MODT_SOURCE=mine\n"}


def test_removing_leaves_nothing_and_can_be_repeated(tmp_path):
    install(tmp_path, *(word for name in DROP_INS for word in ("--with", name)))
    assert install(tmp_path, "--remove") == {}
    assert install(tmp_path, "--remove") == {}


def test_another_prefix_is_that_of_the_program(tmp_path):
    unit = install(tmp_path, "--prefix", "/srv/modt")["etc/systemd/system/modt.service"]
    assert "ExecStart=/srv/modt/bin/modt run" in unit
    assert "/opt/modt" not in unit


def test_an_unknown_drop_in_is_refused(tmp_path):
    with pytest.raises(SystemExit):
        install(tmp_path, "--with", "nothing")
