"""Journals of real missions replay to the same effects, whatever is changed in the core."""

from __future__ import annotations

import pytest

from fleet.core.events import decode_event, encode_event
from fleet.core.state import State
from fleet.core.step import replay
from tests.replay.journal_files import HERE, effects_of, events_in
from tests.support.household import SKILLS

JOURNALS = sorted(path.name.removesuffix(".events.jsonl") for path in HERE.glob("*.events.jsonl"))


def test_there_are_journals() -> None:
    assert {"two-cups", "find-cup"} <= set(JOURNALS)


@pytest.mark.parametrize("name", JOURNALS)
def test_the_same_events_have_the_same_effects(name: str) -> None:
    expected = (HERE / f"{name}.effects.txt").read_text().splitlines()
    assert list(effects_of(events_in(name))) == expected


@pytest.mark.parametrize("name", JOURNALS)
def test_a_crash_anywhere_comes_back_to_the_same_state(name: str) -> None:
    journal = events_in(name)
    whole = replay(journal, State(skills=SKILLS))
    for cut in range(0, len(journal), 7):
        before = replay(journal[:cut], State(skills=SKILLS))
        again = [decode_event(encode_event(event)) for event in journal[cut:]]
        assert replay(again, before) == whole
