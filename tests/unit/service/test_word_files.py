"""Words of a user's own: read from files, kept by the planner's state, used in sentences."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import msgspec
import pytest

from fleet.core.state import Policy, State
from fleet.errors import BadLanguageFile, NotUnderstood
from fleet.language import Reading, Vocabulary, read
from fleet.language.words.wordbook import shipped_language, wordbook_of
from fleet.service.word_files import load_words
from keyexpr_schema.config_files import config_file
from tests.support.language_flat_said import SPOKEN

WORKSHOP = config_file("language", "workshop")


def with_words(*files: Path) -> Vocabulary:
    return replace(SPOKEN, language=wordbook_of(load_words(files)))


@pytest.mark.parametrize(
    ("said", "plain"),
    [
        ("Right then, schlep the fork to the kitchen", "bring the fork to the kitchen"),
        ("trundle the fork off to the kitchen", "bring the fork to the kitchen"),
        ("track down the fork", "find the fork"),
        ("kick on the lamp, line down", "switch on the lamp at once"),
        ("When the shift allows, square the lamp away", "put the lamp away"),
    ],
)
def test_the_shipped_example_says_what_plain_words_say(said: str, plain: str) -> None:
    own, known = read(said, with_words(WORKSHOP)), read(plain, SPOKEN)
    assert isinstance(own, Reading)
    assert isinstance(known, Reading)
    assert own.goals == known.goals
    with pytest.raises(NotUnderstood):
        read(said, SPOKEN)


def test_several_files_are_added_to_each_other(tmp_path: Path) -> None:
    own = tmp_path / "own.yaml"
    own.write_text("verbs: {move: [hoick]}\nPOLITE: [prithee]\n", encoding="utf-8")
    words = with_words(WORKSHOP, own)
    assert read("Prithee hoick the fork to the kitchen", words)
    assert read("schlep the fork to the kitchen", words)


def test_words_stand_in_the_state_and_outlive_a_snapshot() -> None:
    state = State(policy=Policy(words=load_words((WORKSHOP,))))
    kept = msgspec.msgpack.decode(msgspec.msgpack.encode(state.policy), type=Policy)
    assert kept == state.policy
    book = state.vocabulary().wordbook
    assert ("schlep",) in {entry.head for entry in book.verbs}
    assert state.vocabulary().wordbook is book
    assert State().vocabulary().wordbook is shipped_language()


@pytest.mark.parametrize(
    ("written", "says"),
    [
        ("[", "is not YAML: line 2"),
        ("- a", "there must be a mapping of names to lists of phrases"),
        ("POLIT: [a]", "there is no 'POLIT'; known are POLITE, "),
        ("verbs: {moove: [a]}", "verbs: there is no 'moove'; known are move, "),
        ("verbs: [move]", "verbs: there must be a mapping"),
        ("verbs: {move: lug}", "verbs: move must be a list of phrases"),
        ("same_verbs: {switch on: [true]}", "same_verbs: switch on[0]: True is no phrase"),
        ("POLITE: please", "POLITE must be a list of phrases"),
        ("particles: [false]", "particles[0]: False is no phrase; put it in quotes"),
        ("rooms: [[a], b]", "rooms[1] must be a list of phrases"),
    ],
)
def test_a_file_that_is_wrong_is_refused(tmp_path: Path, written: str, says: str) -> None:
    own = tmp_path / "own.yaml"
    own.write_text(written, encoding="utf-8")
    with pytest.raises(BadLanguageFile) as refused:
        load_words((own,))
    assert says in str(refused.value)
    assert str(refused.value).startswith(str(own))
    assert "\n" not in str(refused.value)


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadLanguageFile, match=r"none.yaml cannot be read"):
        load_words((tmp_path / "none.yaml",))
