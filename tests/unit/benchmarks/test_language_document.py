"""The tables of docs/language.md are what the data and the reader say."""

from __future__ import annotations

from benchmarks.language.document import EXAMPLES, PAGE, SENSES, TAGS, document
from benchmarks.language.entries import load_suite
from fleet.language.words.own_words import shipped_verbs, shipped_words


def test_the_page_is_as_the_words_and_the_reader_have_it() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert page == document(page), "run: python -m benchmarks.language.document"


def test_a_page_with_other_tables_is_not() -> None:
    page = PAGE.read_text(encoding="utf-8")
    stale = page.replace("| Move the laptop to the bedroom. |", "| Move it. |")
    assert stale != page
    assert document(stale) == page


def test_all_that_the_page_names_is_there() -> None:
    assert SENSES.keys() == shipped_verbs()["verbs"].keys()
    assert TAGS.keys() <= shipped_words().keys()
    assert {sentence.entry.id for sentence in load_suite("dev", None)} >= EXAMPLES
