"""The core with its journal: bounded starts, snapshots that come, and events that are set aside."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from fleet.core import events, over, step
from fleet.core.effects import MakePlan, Publish, Retract
from fleet.core.events import Event, decode_event
from fleet.core.handlers import plan_results
from fleet.core.state import LOGIC, State
from fleet.service import journaled_core
from fleet.service.event_journal import EventJournal
from fleet.service.journaled_core import JournaledCore
from fleet.service.recovery import recover
from keyexpr_schema.keyspace import FACT, ORDER
from keyexpr_schema.payloads.goals import Goal
from keyexpr_schema.payloads.requests import PlanRequest
from keyexpr_schema.payloads.tasks import OrderAddress
from keyexpr_schema.payloads.world import FactAddress
from tests.replay.journal_files import events_in
from tests.support.fleet_model import FleetModel
from tests.support.household import PLACES, SKILLS, bring, carrier, fact, manipulator

AT: dict[str, Any] = {"time_s": 1.0, "wall_time_s": 1.0}


def mission() -> FleetModel:
    model = FleetModel((manipulator(), carrier()), cups=2)
    model.plan(bring(1, "hallway"))
    model.finish()
    return model


class Run:
    """One run of a planner over a folder, without keys."""

    def __init__(self, folder: Path) -> None:
        self.told: list[str] = []
        self._journal = EventJournal(folder)
        self.core = JournaledCore(self._journal, self._hear)

    def _hear(self, event: Event, reason: str) -> None:
        self.told.append(f"{type(event).__name__}: {reason}")

    def __enter__(self) -> Run:
        self._journal.__enter__()
        self.recovered = self.core.recover(SKILLS, lambda effects: None)
        return self

    def __exit__(self, *_: object) -> None:
        self._journal.__exit__()

    def start(self, epoch: int) -> None:
        self.core.apply(
            events.PlannerStarted(epoch=epoch, incarnation="i", skills=SKILLS, logic=LOGIC, **AT)
        )


async def test_a_planner_that_restarts_often_replays_ever_the_same_little(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Killed after a few events each time: what a run replayed counts for the next snapshot."""
    monkeypatch.setattr(journaled_core, "SNAPSHOT_EVERY", 20)
    replayed = []
    for number in range(12):
        with Run(tmp_path) as run:
            replayed.append(run.recovered.replayed)
            run.start(number + 1)
            for more in range(6):
                value = fact("cup_1", "at", f"place_{number}_{more}")
                run.core.apply(events.FactPut(fact=value, **AT))
                if run.core.snapshot_due(idle=False):
                    await run.core.keep_snapshot(())
    assert max(replayed) < 20 + 7
    assert replayed.count(0) + sum(count < 14 for count in replayed) > 3


def test_a_clean_end_leaves_nothing_to_replay(tmp_path: Path) -> None:
    with Run(tmp_path) as run:
        for line in mission().journal:
            run.core.apply(decode_event(line))
        state = run.core.state
        run.core.keep_last_snapshot(())
    with Run(tmp_path) as run:
        assert run.recovered.replayed == 0
        assert run.core.state == state


def test_what_was_to_be_deleted_is_remembered_until_it_is_confirmed(tmp_path: Path) -> None:
    gone = Retract(ORDER, OrderAddress("hsr", "p", "t1"))
    said = fact("cup_1", "at", "hallway", "planner")
    own = Publish(FACT, FactAddress.of(said.key), said)
    with Run(tmp_path) as run:
        run.start(1)
        run.core.keep_last_snapshot((gone, own))
    for _ in range(2):
        with Run(tmp_path) as run:
            assert run.recovered.retracted == (gone,)
            assert run.recovered.concluded == {said.key}
            run.start(2)  # and killed before anything is confirmed
    with Run(tmp_path) as run:
        run.core.keep_last_snapshot(())
    with Run(tmp_path) as run:
        assert run.recovered.retracted == ()


def test_deletions_of_the_events_since_the_snapshot_are_done_again(tmp_path: Path) -> None:
    model = mission()
    with Run(tmp_path) as run:
        for line in model.journal:
            run.core.apply(decode_event(line))
    with Run(tmp_path) as run:
        orders = {retract.address for retract in run.recovered.retracted if retract.key is ORDER}
    assert len(orders) == 4, "each task had an order, and none has one now"


@pytest.fixture
def atlantis(monkeypatch: pytest.MonkeyPatch) -> Event:
    """An event that the core breaks on, whatever was before it."""

    def let_go(state: State) -> State:
        if "atlantis" in state.places:
            raise ZeroDivisionError("under water")
        return over.let_go(state)

    monkeypatch.setattr(step, "let_go", let_go)
    return events.PlacePut(place=replace(PLACES[0], place="atlantis"), **AT)


def test_an_event_that_breaks_the_core_is_set_aside_and_told(
    tmp_path: Path, atlantis: Event
) -> None:
    with Run(tmp_path) as run:
        run.start(1)
        before = run.core.state
        assert run.core.apply(atlantis) == ()
        assert run.core.state is before
        assert run.told == ["PlacePut: ZeroDivisionError: under water"]
        run.core.apply(events.FactPut(fact=fact("cup_1", "at", "kitchen"), **AT))
        assert run.core.state.facts, "what comes after it is handled"
    with closing(sqlite3.connect(tmp_path / "events.db")) as db, db:
        [(times, trace, logic)] = db.execute("SELECT times, traceback, logic FROM set_aside")
        assert (times, logic) == (1, LOGIC)
        assert "in let_go" in trace


def test_it_does_not_come_again_at_the_next_start(
    tmp_path: Path, atlantis: Event, monkeypatch: pytest.MonkeyPatch
) -> None:
    with Run(tmp_path) as run:
        run.start(1)
        run.core.apply(atlantis)
    calls = []
    monkeypatch.setattr(journaled_core, "step", lambda *args: calls.append(args))
    with Run(tmp_path) as run:
        later = replace(atlantis, time_s=9.0, wall_time_s=9.0, monotonic_s=9.0)
        assert run.core.apply(later) == ()
        assert calls == [], "the core is not asked again"
        assert run.told == ["PlacePut: it could not be handled before"]


def test_one_in_the_journal_is_taken_out_of_it(tmp_path: Path, atlantis: Event) -> None:
    """As a run before this one kept it."""
    with EventJournal(tmp_path) as journal:
        for event in (
            events.PlannerStarted(epoch=1, incarnation="i", skills=SKILLS, logic=LOGIC, **AT),
            events.PlacePut(place=replace(PLACES[0], place="kitchen"), **AT),
            atlantis,
            events.FactPut(fact=fact("cup_1", "at", "kitchen"), **AT),
        ):
            journal.append(event)
    for replayed in (3, 3):
        with Run(tmp_path) as run:
            assert run.recovered.replayed == replayed
            assert set(run.core.state.places) == {"kitchen"}
            assert run.core.state.facts
    with EventJournal(tmp_path) as journal:
        assert [number for number, _ in journal.events()] == [1, 2, 4]


def test_a_plan_that_cannot_be_taken_over_has_failed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = FleetModel((manipulator(), carrier()), cups=2, late=True)
    model.plan(bring(1, "hallway"))
    [answer] = model.answers
    assert isinstance(answer, events.PlanningSucceeded)
    with Run(tmp_path) as run:
        for line in model.journal:
            run.core.apply(decode_event(line))
        monkeypatch.setattr(plan_results, "reconcile", lambda *args: 1 / 0)
        run.core.apply(answer)
        assert not any(entry.job for entry in run.core.state.plans.values())
        assert run.told[0].startswith("PlanningSucceeded: ZeroDivisionError")


async def test_a_snapshot_that_cannot_be_written_costs_nothing_but_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*args: object) -> None:
        raise OSError(28, "No space left on device")

    with Run(tmp_path) as run:
        run.start(1)
        monkeypatch.setattr(EventJournal, "write_snapshot", full)
        await run.core.keep_snapshot(())
        run.core.keep_last_snapshot(())
    with EventJournal(tmp_path) as journal:
        assert recover(journal, SKILLS).replayed == 1


def test_a_journal_of_before_starts_becomes_a_snapshot_and_goes_on(tmp_path: Path) -> None:
    """Its events bring no skills and no logic number; new logic does not go over them again."""
    with EventJournal(tmp_path) as journal:
        for event in events_in("two-cups"):
            journal.append(event)
    with Run(tmp_path) as run:
        assert run.recovered.replayed > 0
        assert run.core.replayable == 0
        assert run.told == []
        run.start(epoch=run.core.state.epoch + 1)
        goal = Goal(goal="another", text="bring cup 1 to the kitchen")
        run.core.apply(events.GoalPut(goal=goal, **AT))
        request = PlanRequest(request="r", goals=("another",))
        effects = run.core.apply(events.PlanRequested(request=request, **AT))
        assert any(isinstance(effect, MakePlan) for effect in effects)
    with Run(tmp_path) as run:
        assert run.recovered.replayed == 3
        assert run.core.state.logic == LOGIC
