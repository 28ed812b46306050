"""What others see of a planner is on its disk before: a power cut takes nothing of it back."""

from __future__ import annotations

import asyncio
import os
import shutil
import threading
from pathlib import Path

from fleet.core import events
from fleet.core.state import Policy
from fleet.history.archive import Archive
from fleet.history.audit_log import AuditLog
from fleet.service.event_journal import EventJournal
from fleet.service.planner_service import PlannerService
from fleet.service.planning.pool import PlanningPool
from fleet.service.skill_models import load_all_skills
from keyexpr_schema.keyspace import GOAL_SPEC, GOAL_STATUS
from keyexpr_schema.payloads.goals import Goal, GoalAddress
from keyexpr_schema.transport.session import open_session
from tests.support.polling import DEADLINE_S, until

G1 = GoalAddress("g1")
WAL = "events.db-wal"


def tick(number: int) -> events.Event:
    return events.TimerFired(time_s=float(number), wall_time_s=float(number), monotonic_s=None)


def test_what_was_synced_is_there_after_a_power_cut(tmp_path: Path) -> None:
    with EventJournal(tmp_path / "one") as journal:
        for number in range(3):
            journal.append(tick(number))
        journal.sync()
        length = (tmp_path / "one" / WAL).stat().st_size
        journal.append(tick(3))
        shutil.copytree(tmp_path / "one", tmp_path / "two")
    os.truncate(tmp_path / "two" / WAL, length)
    with EventJournal(tmp_path / "two") as journal:
        assert [entry.event.time_s for entry in journal.events()] == [0.0, 1.0, 2.0]


class SlowDisk(EventJournal):
    """A journal on a disk that takes its time, as soon as `slow` is set, until it is `free`."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.slow = False
        self.free, self.waits = threading.Event(), threading.Event()

    def sync(self) -> None:
        """As ever, once the disk is free."""
        if self.slow:
            self.waits.set()
            assert self.free.wait(DEADLINE_S)
        super().sync()


async def test_nothing_leaves_the_planner_before_it_is_on_the_disk(
    session_config, tmp_path: Path
) -> None:
    folder = tmp_path / "planner"
    pool = PlanningPool(None, folder / "failed")
    with SlowDisk(folder) as journal, Archive(folder) as archive, AuditLog(folder) as audit:
        async with (
            open_session(session_config(component="planner")) as own,
            open_session(session_config()) as session,
            pool.running(),
        ):
            ready = asyncio.Event()
            service = PlannerService(
                own, journal, pool, load_all_skills(()), archive, audit, Policy()
            )
            running = asyncio.create_task(service.run(ready))
            try:
                await ready.wait()

                async def told() -> set[str]:
                    return {address.goal for address in await session.list(GOAL_STATUS)}

                async def wanted(name: str) -> None:
                    goal = Goal(goal=name, text="Bring the cup to the kitchen.")
                    await session.confirm(GOAL_SPEC, GoalAddress(name), goal)

                await wanted("first")
                await until(told, "the planner to be done with what there was before")
                journal.slow = True
                names = {f"g{number}" for number in range(20)}
                for name in ("g0", *sorted(names - {"g0"})):
                    await wanted(name)
                await asyncio.to_thread(journal.waits.wait, DEADLINE_S)
                assert service.state.goals.get("g0") is not None  # it knows, and says nothing
                assert await told() == {"first"}
                journal.free.set()

                async def all_told() -> bool:
                    return await told() == {"first", *names}

                await until(all_told, "the planner to say how the goals stand")
            finally:
                journal.free.set()
                running.cancel()
                await asyncio.gather(running, return_exceptions=True)
