"""What the simulation's configuration files have in common."""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

import msgspec

from keyexpr_schema.config_files import config_file
from keyexpr_schema.errors import NoConfigFile
from keyexpr_schema.typed_yaml import read_typed
from keyexpr_schema.yaml_reader import YamlFile
from sim.errors import BadFile

S = TypeVar("S", bound=msgspec.Struct)


class FileEntry(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Base of what stands in a configuration file: an unknown field is an error, not a wish."""


def find_file(kind: str, name: str | Path, named_in: Path | None = None) -> Path:
    """See `config_file`; a name of no file is a `BadFile`."""
    try:
        return config_file(kind, name, named_in)
    except NoConfigFile as error:
        raise BadFile(str(error)) from None


def read_entries(path: Path, kind: type[S], what: str) -> tuple[S, YamlFile]:
    """The file at `path` as a `kind`, and where in it what stands; `what` names it in messages.

    Raises:
        BadFile: it is missing, not YAML, or not a `kind`.
    """
    return read_typed(path, kind, what, BadFile)
