"""What the store has no room for waits: the last word of each variable, and not of too many."""

from __future__ import annotations

from pathlib import Path
from unittest.mock import create_autospec

import pytest

from keyexpr_schema.errors import WriteRefused
from keyexpr_schema.facts import FactKey
from keyexpr_schema.full_disk import FullDisk
from keyexpr_schema.payloads.world import Fact, FactAddress
from keyexpr_schema.transport.session import Session
from workers import host_clock
from workers.orders import journal, refused_facts
from workers.orders.boots import Boot
from workers.orders.journal import Journal
from workers.orders.outbox import Outbox


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


@pytest.mark.parametrize(
    ("boot", "age_s"),
    [
        (Boot("today", 30.0, 90_000.0), 3600.0),  # said an hour before, whatever runs since when
        (Boot("yesterday", 130.0, 86_500.0), 100.0),
        (Boot("today", 30.0, 0.0), 30.0),  # nobody has set the clock yet
    ],
)
def test_a_word_of_before_the_host_was_started_again_is_as_old_as_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, boot: Boot, age_s: float
) -> None:
    """Else it would come after what others have said since."""
    path = tmp_path / "hsr.journal"
    for module in (host_clock, refused_facts, journal):
        monkeypatch.setattr(module, "running_s", lambda: at.running_s)
    monkeypatch.setattr(Boot, "now", lambda: at)
    at = Boot("yesterday", 10.0, 86_380.0)
    with Journal(path):
        pass
    at = Boot("yesterday", 30.0, 86_400.0)
    with Journal(path) as opened:
        opened.refused.keep(fact(1), 0.0)
        opened.send(fact(2))
    at = boot
    with Journal(path) as opened:
        following, unsent = opened.refused.next(), opened.unsent()
        assert following is not None
        assert unsent is not None
        assert following[1] == unsent.age_s == age_s


async def test_what_there_is_room_for_waits_for_nothing_that_there_is_none_for(
    tmp_path: Path,
) -> None:
    asked: list[str] = []

    async def confirm(_: object, address: FactAddress, *__: object, **___: object) -> None:
        asked.append(address.subject)
        if address.subject != "cup_3":
            raise WriteRefused("there are too many")

    session = create_autospec(Session, instance=True)
    session.confirm.side_effect = confirm
    with Journal(tmp_path / "hsr.journal") as opened:
        for number in (1, 2, 3, 4):
            opened.refused.keep(fact(number), 0.0)
        disk = FullDisk(tmp_path, "it", "it waits", lambda _: None)
        await Outbox(session, opened, disk).try_again()
    assert asked == ["cup_1", "cup_2", "cup_3", "cup_4", "cup_1"][: len(asked)]
    assert "cup_4" in asked
    assert waiting(tmp_path / "hsr.journal") == [fact(1), fact(2), fact(4)]
