"""Words of a user's own, from the files that the configuration names."""

from __future__ import annotations

from pathlib import Path

from fleet.errors import BadLanguageFile
from fleet.language.words.own_words import OwnWords, own_words
from keyexpr_schema.config_files import read_yaml


def load_words(word_files: tuple[Path, ...] = ()) -> tuple[OwnWords, ...]:
    """What these files add to the words of the language.

    Raises:
        BadLanguageFile: one of them cannot be read, or what is in it is not right.
    """
    return tuple(own_words(read_yaml(path, BadLanguageFile), str(path)) for path in word_files)
