"""Configuration of language: what of it a person confirms."""

from __future__ import annotations

from enum import Enum
from pathlib import Path

import msgspec

from fleet.errors import BadLanguageConfig
from fleet.planner_file import planner_section
from keyexpr_schema.config_files import config_file


class Confirm(str, Enum):
    """Which readings a person has to confirm, of sentences that a language model has paraphrased.

    `coarse`: those that could do much harm if they were not meant; `fleet.core.confirmation` says
    which these are. A paraphrase that can mean several things is asked about in any case.
    """

    ALWAYS = "always"
    COARSE = "coarse"
    NEVER = "never"


class LanguageConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The `language` section of a planner configuration."""

    confirm: Confirm = Confirm.ALWAYS


def load_language_config(path: Path | None = None) -> LanguageConfig:
    """The `language` section of the file at `path`; else of `planner.yaml` (see `config_file`).

    Raises:
        BadLanguageConfig: the file cannot be read, or a field is not right.
    """
    path = path or config_file(".", "planner")
    return planner_section(path, "language", LanguageConfig, BadLanguageConfig)
