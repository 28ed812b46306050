"""Words of a user's own, from the files that the configuration names."""

from __future__ import annotations

from pathlib import Path

from fleet.errors import BadLanguageFile
from fleet.language.words.own_words import OwnWords, own_words
from keyexpr_schema.yaml_reader import read_yaml_file


def load_words(word_files: tuple[Path, ...] = ()) -> tuple[OwnWords, ...]:
    """What these files add to the words of the language.

    Raises:
        BadLanguageFile: one of them cannot be read, or what is in it is not right.
    """
    files = [read_yaml_file(path, BadLanguageFile) for path in word_files]
    return tuple(own_words(file.data, file) for file in files)
