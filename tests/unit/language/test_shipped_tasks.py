"""The tasks that are shipped: their phrases take no sentence over that means something else."""

from __future__ import annotations

from dataclasses import replace

import pytest

from benchmarks.language.reader import vocabulary_of
from benchmarks.language.worlds import NOW
from fleet.errors import NotUnderstood
from fleet.language import Ambiguity, Reading, Vocabulary, read
from fleet.language.methods.patterns import rows_of
from fleet.service.task_files import load_all_tasks

SHIPPED = load_all_tasks()
TAKEN_OVER = {
    "serve_somebody_drinks": "one drink, where the grammar takes all that there are",
    "do_the_laundry": "what is dirty, where the grammar takes any one piece for `laundry`",
    "take_out_the_rubbish": "emptied, where the grammar has somebody hold the bin",
}
"""Tasks whose phrases the grammar reads otherwise in some world, and why they go before it."""


def said(words: Vocabulary) -> list[tuple[str, str]]:
    """Phrases of every task, with names of this world."""
    names = {
        "number": "two",
        "place": next(iter(words.places.values())).label,
        "person": next(o.label for o in words.objects.values() if words.is_person(o.object)),
    }
    return [
        (task.name, " ".join(p if isinstance(p, str) else names[p.type] for p in row))
        for task in SHIPPED
        for phrase in task.says
        for row in rows_of(phrase)[:1]
    ]


def meant(text: str, words: Vocabulary) -> Reading | Ambiguity | None:
    try:
        return read(text, words, NOW)
    except NotUnderstood:
        return None


@pytest.mark.parametrize("world", ["house", "hospital"])
def test_a_shipped_task_takes_no_sentence_over_that_means_something(world: str) -> None:
    words = vocabulary_of(world)
    without = replace(words, tasks=())
    called = 0
    for task, text in said(words):
        alone, found = meant(text, without), meant(text, words)
        called += isinstance(found, Reading) and bool(found.methods)
        assert alone is None or found == alone or task in TAKEN_OVER, text
    assert called


def test_all_words_between_parameters_of_shipped_phrases_are_told_apart() -> None:
    """No two tasks have a phrase in common."""
    rows = [(row, task.name) for task in SHIPPED for p in task.says for row in rows_of(p)]
    by_row = dict(rows)
    assert all(by_row[row] == name for row, name in rows)
