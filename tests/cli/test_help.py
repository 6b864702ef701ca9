"""The help of the commands, by itself or with --help."""

import re
import shlex
import subprocess

import pytest

from modt import assets
from modt.cli import main
from modt.schemes import SENSORS
from modt_commands import profile
from modt_commands.completion import SHELLS, parsers
from tools.docs.commands import commands


def help_of(program, *arguments, capsys):
    """The text that --help prints."""
    with pytest.raises(SystemExit) as ended:
        program([*arguments, "--help"])
    assert ended.value.code == 0
    return capsys.readouterr().out


@pytest.mark.parametrize(
    ("program", "words", "names"),
    [
        (main.main, [], main.commands()),
        (profile.main, [], profile.COMMANDS),
        (main.main, ["profile"], ("fit", "show", "schema")),
    ],
    ids=["modt", "modt-profile", "modt profile"],
)
def test_a_bare_command_prints_its_help_with_every_command_and_fails(program, words, names, capsys):
    assert program(words) == 2
    bare = capsys.readouterr()
    assert (bare.out, bare.err) == (help_of(program, *words, capsys=capsys), "")
    assert set(re.findall(r"^    (\w+)", bare.out, re.MULTILINE)) == set(names)


def test_run_shows_an_address_of_every_sensor(capsys):
    shown = help_of(main.main, "run", capsys=capsys)
    for scheme in SENSORS:
        assert re.search(rf"modt run '?{scheme}://", shown)


@pytest.mark.parametrize(
    "parser",
    [parser for program in parsers() for _, parser in commands(program)],
    ids=lambda parser: parser.prog,
)
def test_every_command_has_examples_that_its_parser_takes(parser):
    lines = parser.format_help().partition("examples:\n")[2].splitlines()
    assert lines
    for line in lines:
        example, meaning = re.fullmatch(r"  (.*?) {2,}(\S.*)", line).groups()
        assert meaning
        words = shlex.split(re.sub(r"\beval\b|\$\(|\)|\||>.*|(?<!-)\bsource\b", "", example), posix=True)
        words = words[0].split() if len(words) == 1 else words
        assert " ".join(words).startswith(parser.prog)
        assert vars(parser.parse_args(words[len(parser.prog.split()) :]))


def test_the_profiles_are_listed_with_one_line_each(capsys):
    assert main.main(["profiles"]) == 0
    lines = [line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines()]
    assert [name for name, _ in lines] == sorted(path.stem for path in assets.folder("profiles").glob("*.yaml"))


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        ("modt re", {"replay"}),
        ("modt profile ", {"fit", "show", "schema"}),
        ("modt replay --mo", {"--mode"}),
        ("modt replay --mode e", {"efficient"}),
        ("modt run --profile vlp", {"vlp-16", "vlp-32c"}),
        ("modt-profile report run --h", {"--help", "--html"}),
    ],
)
def test_a_shell_completes_commands_options_and_values(words, offered, capsys):
    main.main(["completion", "bash"])
    script = capsys.readouterr().out
    typed = words.split(" ")
    function = f"_shtab_{typed[0].replace('-', '')}"
    asked = f'COMP_WORDS=({shlex.join(typed)}); COMP_CWORD={len(typed) - 1}; {function}; echo "${{COMPREPLY[@]}}"'
    done = subprocess.run(["bash", "-c", f"{script}\n{asked}"], capture_output=True, text=True, check=True)
    assert offered <= set(done.stdout.split())
    assert all(word.startswith(typed[-1]) for word in done.stdout.split())


def test_every_shell_is_told_every_command(capsys):
    for shell in SHELLS:
        main.main(["completion", shell])
        script = capsys.readouterr().out
        assert all(name in script for name in (*main.commands(), *profile.COMMANDS))
