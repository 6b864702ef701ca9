"""Generate the page of profile keys and their JSON Schema."""

from __future__ import annotations

from dataclasses import fields

from modt import assets
from modt.config import MountedSensor, ProfileConfig
from modt.profile import SENSORS
from modt_commands.profile_group import value_text
from modt_commands.profile_schema import FILE, keys, schema_text
from tools.docs.sections import DOCS, replace_section, write

DOCUMENT = DOCS / "profile-keys.md"
SCHEMA = assets.folder("profiles") / FILE
MARK = "tools.docs.profile_keys"


def page() -> str:
    """The first sentence on the configuration of each stage, and a table of its keys."""
    sections = []
    for stage in fields(ProfileConfig):
        if stage.name != SENSORS:
            of_stage = [key for key in keys() if key.path.startswith(f"{stage.name}.")]
            sections.append((stage.name, str(stage.default_factory.__doc__), of_stage))
    of_sensor = [key for key in keys(MountedSensor) if key.path != "name"]
    lines: list[str] = []
    for name, about, of_section in [*sections, (f"{SENSORS}.NAME", str(MountedSensor.__doc__), of_sensor)]:
        lines += ["", f"## {name}", "", about.partition("\n")[0], ""]
        lines += ["| key | default | from, to | meaning |", "|---|---|---|---|"]
        for key in of_section:
            last = key.path.rpartition(".")[2]
            lines.append(f"| `{last}` | {value_text(key.default)} | {key.bounds} | {key.facts['meaning']} |")
    return "\n".join(lines[1:])


def document() -> str:
    """The page with its section up to date."""
    return replace_section(DOCUMENT.read_text(encoding="utf-8"), MARK, page())


def main() -> None:
    write(__doc__, DOCUMENT, document)
    SCHEMA.write_text(schema_text(), encoding="utf-8")


if __name__ == "__main__":
    main()
