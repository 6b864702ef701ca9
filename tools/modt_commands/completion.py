"""`modt completion`: a script by which a shell completes commands, options and their values."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module

from modt import assets
from modt.cli import main as modt
from modt.cli import options
from modt_commands import profile as modt_profile

SHELLS = ("bash", "zsh", "fish")


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the command and its options."""
    p = commands.add_parser("completion", help="print a script by which a shell completes modt and modt-profile")
    p.add_argument("shell", choices=SHELLS, metavar="|".join(SHELLS), help="shell")
    options.add_examples(
        p,
        'eval "$(modt completion bash)"                    in ~/.bashrc',
        'eval "$(modt completion zsh)"                     in ~/.zshrc, after compinit',
        "modt completion fish | source                      in config.fish",
    )
    p.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Print the script."""
    print("\n".join(fish() if arguments.shell == "fish" else bash(arguments.shell)))
    return 0


@dataclass(frozen=True, slots=True)
class Command:
    """A command or a group of commands.

    Attributes:
        words: the program and the names that lead to it.
        summary: its line in the help above it.
        parser: its parser.
        names: commands of a group; none of a command.
    """

    words: str
    summary: str
    parser: argparse.ArgumentParser
    names: tuple[str, ...] = ()


def commands() -> Iterator[Command]:
    """Every command, and every group after its commands."""
    for prog, modules in (("modt", modt.commands()), ("modt-profile", modt_profile.COMMANDS)):
        top = argparse.ArgumentParser(prog=prog)
        choice = top.add_subparsers()
        for module in dict.fromkeys(modules.values()):
            import_module(module).add_parser(choice)
        yield from _below(prog, "", top)


def _below(words: str, summary: str, parser: argparse.ArgumentParser) -> Iterator[Command]:
    names: list[str] = []
    for group in (action for action in parser._actions if isinstance(action, argparse._SubParsersAction)):
        summaries = {action.dest: action.help or "" for action in group._choices_actions}
        for name, inner in group.choices.items():
            names.append(name)
            yield from _below(f"{words} {name}", summaries[name], inner)
    yield Command(words, summary, parser, tuple(names))


def _values(action: argparse.Action) -> list[str]:
    """Values of an option that can be listed."""
    if "--profile" in action.option_strings:
        return sorted(path.stem for path in assets.folder("profiles").glob("*.yaml"))
    return [str(choice) for choice in action.choices or ()]


def bash(shell: str) -> list[str]:
    """Lines of the script; zsh runs it by its emulation of bash's completion."""
    lines = ["autoload -U +X bashcompinit && bashcompinit"] if shell == "zsh" else []
    lines += [
        "_modt() {",
        '  local word="${COMP_WORDS[COMP_CWORD]}" before="${COMP_WORDS[COMP_CWORD-1]}" words=""',
        '  case "${COMP_WORDS[0]##*/} ${COMP_WORDS[*]:1:COMP_CWORD-1} " in',
    ]
    values: dict[str, str] = {}
    for command in commands():
        actions = command.parser._actions
        offered = [*command.names, *(name for action in actions for name in action.option_strings)]
        lines.append(f'    "{command.words} "*) words="{" ".join(offered)}" ;;')
        for action in actions:
            values.update({name: " ".join(_values(action)) for name in action.option_strings if _values(action)})
    lines += ["  esac", '  case "$before" in']
    lines += [f'    {name}) words="{known}" ;;' for name, known in values.items()]
    lines += [
        "  esac",
        '  COMPREPLY=($(compgen -W "$words" -- "$word"))',
        "}",
        "complete -o default -F _modt modt modt-profile",
    ]
    return lines


def fish() -> list[str]:
    """Lines of the script."""
    lines = []
    for command in commands():
        prog, *path = command.words.split()
        names = command.names
        given = [f"__fish_seen_subcommand_from {name}" for name in path]
        not_yet = [f"not __fish_seen_subcommand_from {' '.join(names)}"] if names else []
        when = f'-n "{"; and ".join([*given, *not_yet])}" ' if given or not_yet else ""
        lines += [f"complete -c {prog} {when}-f -a {name}" for name in names]
        for action in command.parser._actions:
            for name in (name for name in action.option_strings if name.startswith("--")):
                known = f' -x -a "{" ".join(_values(action))}"' if _values(action) else ""
                lines.append(f"complete -c {prog} {when}-l {name[2:]}{known}")
    return lines
