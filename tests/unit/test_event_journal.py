"""The planner's event journal: order, snapshots, one planner at a time."""

from __future__ import annotations

from pathlib import Path

import pytest

from fleet.core.events import decode_event
from fleet.core.state import State
from fleet.core.step import replay, step
from fleet.service import event_journal
from fleet.service.event_journal import EventJournal, JournalInUse
from tests.fleet_model import FleetModel
from tests.household import SKILLS, bring, carrier, manipulator


def mission() -> FleetModel:
    model = FleetModel((manipulator(), carrier()), cups=2)
    model.plan(bring(1, "hallway"), bring(2, "living_room"))
    model.finish()
    return model


def keep(folder: Path, model: FleetModel) -> None:
    with EventJournal(folder) as journal:
        state = State()
        for line in model.journal:
            state, _ = step(state, decode_event(line), SKILLS)
            journal.append(decode_event(line), state)


def test_events_come_back_in_order(tmp_path: Path) -> None:
    model = mission()
    keep(tmp_path, model)
    with EventJournal(tmp_path) as journal:
        assert not journal.empty
        assert replay(journal.events(), SKILLS) == model.state


def test_a_new_journal_is_empty(tmp_path: Path) -> None:
    with EventJournal(tmp_path / "new") as journal:
        assert journal.empty
        assert journal.snapshot() == (0, State())


def test_a_snapshot_shortens_the_replay_and_changes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(event_journal, "SNAPSHOT_EVERY", 7)
    model = mission()
    keep(tmp_path, model)
    with EventJournal(tmp_path) as journal:
        number, state = journal.snapshot()
        rest = list(journal.events(number))
        assert number > 0
        assert len(rest) < 7
        assert replay(rest, SKILLS, state) == model.state


def test_a_snapshot_that_does_not_decode_is_left_aside(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(event_journal, "SNAPSHOT_EVERY", 7)
    model = mission()
    keep(tmp_path, model)
    with EventJournal(tmp_path) as journal:
        journal._db.execute("UPDATE snapshots SET state = ?", (b'{"plans": 7}',))
        number, state = journal.snapshot()
        assert number == 0
        assert replay(journal.events(number), SKILLS, state) == model.state


def test_two_planners_cannot_have_one_journal(tmp_path: Path) -> None:
    with EventJournal(tmp_path):
        with pytest.raises(JournalInUse, match="another planner works with"):
            EventJournal(tmp_path).__enter__()
