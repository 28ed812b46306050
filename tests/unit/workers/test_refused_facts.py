"""What the store has no room for waits: the last word of each variable, and not of too many."""

from __future__ import annotations

from pathlib import Path

import pytest

from keyexpr_schema.facts import FactKey
from keyexpr_schema.payloads.world import Fact
from workers.orders import refused_facts
from workers.orders.journal import Journal


def fact(number: int, value: str = "kitchen") -> Fact:
    return Fact(relation="at", subject=f"cup_{number}", value=value, source="hsr")


def waiting(path: Path) -> list[Fact]:
    """What waits in a journal, each once."""
    found: list[Fact] = []
    with Journal(path) as journal:
        while (one := journal.refused.next()) is not None:
            found.append(one[0])
            journal.refused.drop(one[0].key)
    return found


def test_the_last_word_of_each_waits_behind_the_others_and_outlives_the_worker(
    tmp_path: Path,
) -> None:
    path = tmp_path / "hsr.journal"
    with Journal(path) as journal:
        refused = journal.refused
        assert not refused
        for one in (fact(1), fact(2), fact(1, "hallway")):
            assert refused.keep(one, 60.0) is None
        following = refused.next()
        assert following is not None
        assert following[0] == fact(2)
        assert following[1] >= 60.0
        refused.drop(FactKey("at", "cup_3"))
    with Journal(path) as journal:
        assert journal.refused
    assert waiting(path) == [fact(1, "hallway"), fact(2)]
    assert waiting(path) == []


def test_of_too_many_the_oldest_does_not_wait_any_more(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(refused_facts, "MOST", 2)
    path = tmp_path / "hsr.journal"
    with Journal(path) as journal:
        assert [journal.refused.keep(fact(number), 0.0) for number in (1, 2, 3)] == [
            None, None, fact(1)
        ]  # fmt: skip
    assert waiting(path) == [fact(2), fact(3)]
