"""Profiles: YAML to configuration with strict keys, and back."""

from modt.profile.resolved import DEFAULT, Names, Resolved, dump, load, parse, resolve
from modt.profile.yaml_text import from_yaml, to_yaml

__all__ = ["DEFAULT", "Names", "Resolved", "dump", "from_yaml", "load", "parse", "resolve", "to_yaml"]
