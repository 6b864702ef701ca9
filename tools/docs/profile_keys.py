"""Generate the page of profile keys and their JSON Schema."""

from __future__ import annotations

from dataclasses import fields

from modt import assets
from modt.config import ProfileConfig
from modt_commands.profile_group import value_text
from modt_commands.profile_schema import FILE, keys, schema_text
from tools.docs.sections import DOCS, replace_section, write

DOCUMENT = DOCS / "profile-keys.md"
SCHEMA = assets.folder("profiles") / FILE
MARK = "tools.docs.profile_keys"


def page() -> str:
    """The first sentence on the configuration of each stage, and a table of its keys."""
    lines: list[str] = []
    for stage in fields(ProfileConfig):
        about = str(stage.default_factory.__doc__).partition("\n")[0]
        lines += [
            "",
            f"## {stage.name}",
            "",
            about,
            "",
            "| key | default | from, to | meaning |",
            "|---|---|---|---|",
        ]
        for key in keys():
            head, _, name = key.path.partition(".")
            if head == stage.name:
                lines.append(f"| `{name}` | {value_text(key.default)} | {key.bounds} | {key.facts['meaning']} |")
    return "\n".join(lines[1:])


def document() -> str:
    """The page with its section up to date."""
    return replace_section(DOCUMENT.read_text(encoding="utf-8"), MARK, page())


def main() -> None:
    write(__doc__, DOCUMENT, document)
    SCHEMA.write_text(schema_text(), encoding="utf-8")


if __name__ == "__main__":
    main()
