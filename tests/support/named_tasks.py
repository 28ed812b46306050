"""Tasks that goals can name, read in the worlds of the suite of sentences."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from benchmarks.language.reader import vocabulary_of
from benchmarks.language.worlds import NOW
from fleet.language import Reading, Vocabulary, read
from fleet.language.methods.task_file import tasks_from_data
from tests.support.language_house import shown


def words_with(world: str, tasks: dict[str, Any]) -> Vocabulary:
    """A world of the suite in which these tasks are known, and no others."""
    return replace(vocabulary_of(world), tasks=tasks_from_data({"tasks": tasks}, "mine.yaml"))


def reading(text: str, words: Vocabulary) -> Reading:
    """The one thing that a text means."""
    found = read(text, words, NOW)
    assert isinstance(found, Reading), found
    return found


def wanted(text: str, words: Vocabulary) -> str:
    """What a text wants, stage by stage."""
    return shown(reading(text, words))
