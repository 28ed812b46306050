"""The latest values of a running fleet, kept current by the key-space."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NoReturn

from msgspec.structs import astuple

from cli.errors import TooLate
from keyexpr_schema.errors import Unreachable
from keyexpr_schema.facts import FactKey
from keyexpr_schema.keyspace import (
    CLOSURE,
    FACT,
    GOAL_SPEC,
    GOAL_STATUS,
    HOLD,
    PLAN_SPEC,
    PLAN_STATUS,
    ROBOT_SPEC,
    ROBOT_STATE,
    SCHEDULE_SPEC,
    SCHEDULE_STATUS,
    SIM_CLOCK,
    SIM_CONTACTS,
    SIM_SCENE,
    SIM_SENSES,
    SIM_TRUTH,
    STOP,
    STOP_RELEASE,
    TASK_RECORD,
)
from keyexpr_schema.payloads.closures import Closure
from keyexpr_schema.payloads.goals import ENDED_GOALS, Goal, GoalState, GoalStatus
from keyexpr_schema.payloads.holds import Hold
from keyexpr_schema.payloads.motions import Senses
from keyexpr_schema.payloads.plans import Plan, PlanStatus
from keyexpr_schema.payloads.robots import RobotSpec, RobotState
from keyexpr_schema.payloads.schedules import Schedule, ScheduleStatus
from keyexpr_schema.payloads.simulation import ContactCount, Scene, SimClock, Truth
from keyexpr_schema.payloads.stops import Stop, StopRelease
from keyexpr_schema.payloads.tasks import TaskRecord
from keyexpr_schema.payloads.world import Fact

if TYPE_CHECKING:
    from keyexpr_schema.transport.session import Change, Session, Watch

FLEET_KEYS = (
    GOAL_SPEC,
    GOAL_STATUS,
    PLAN_SPEC,
    PLAN_STATUS,
    TASK_RECORD,
    ROBOT_SPEC,
    ROBOT_STATE,
    FACT,
    STOP,
    STOP_RELEASE,
    HOLD,
    CLOSURE,
    SCHEDULE_SPEC,
    SCHEDULE_STATUS,
)
"""What any fleet has."""
SIMULATION_KEYS = (SIM_CLOCK, SIM_TRUTH, SIM_CONTACTS, SIM_SCENE, SIM_SENSES)
"""What only a simulated one has."""
SYNC_S = 10.0
"""Longest time for the store to list what it has."""

_TABLES = {
    GOAL_SPEC.name: "goals",
    GOAL_STATUS.name: "goal_status",
    PLAN_SPEC.name: "plans",
    PLAN_STATUS.name: "plan_status",
    TASK_RECORD.name: "tasks",
    ROBOT_SPEC.name: "robot_specs",
    ROBOT_STATE.name: "robot_states",
    FACT.name: "facts",
    STOP.name: "stops",
    HOLD.name: "holds",
    CLOSURE.name: "closures",
    SCHEDULE_SPEC.name: "schedules",
    SCHEDULE_STATUS.name: "schedule_status",
    STOP_RELEASE.name: "stop_releases",
    SIM_TRUTH.name: "truths",
    SIM_SENSES.name: "senses",
}
_LATEST = {SIM_CLOCK.name: "clock", SIM_CONTACTS.name: "contacts", SIM_SCENE.name: "scene"}


@dataclass
class FleetView:
    """The latest value of every key that matters to a person who watches; by its address.

    `tasks` are by (plan, task), releases by (stop, robot), all else by the one id.

    `changed` is set after each change; whoever waits clears it first (see `until`).
    """

    goals: dict[str, Goal] = field(default_factory=dict)
    goal_status: dict[str, GoalStatus] = field(default_factory=dict)
    plans: dict[str, Plan] = field(default_factory=dict)
    plan_status: dict[str, PlanStatus] = field(default_factory=dict)
    tasks: dict[tuple[str, str], TaskRecord] = field(default_factory=dict)
    robot_specs: dict[str, RobotSpec] = field(default_factory=dict)
    robot_states: dict[str, RobotState] = field(default_factory=dict)
    facts: dict[FactKey, Fact] = field(default_factory=dict)
    stops: dict[str, Stop] = field(default_factory=dict)
    holds: dict[str, Hold] = field(default_factory=dict)
    closures: dict[str, Closure] = field(default_factory=dict)
    schedules: dict[str, Schedule] = field(default_factory=dict)
    schedule_status: dict[str, ScheduleStatus] = field(default_factory=dict)
    stop_releases: dict[tuple[str, str], StopRelease] = field(default_factory=dict)
    truths: dict[str, Truth] = field(default_factory=dict)
    senses: dict[str, Senses] = field(default_factory=dict)
    clock: SimClock | None = None
    contacts: ContactCount | None = None
    scene: Scene | None = None
    failure: Exception | None = None
    changed: asyncio.Event = field(default_factory=asyncio.Event)

    def apply(self, change: Change[Any, Any]) -> None:
        """Take in one change of a key."""
        if (attribute := _LATEST.get(change.key.name)) and change.value is not None:
            setattr(self, attribute, change.value)
        elif attribute := _TABLES.get(change.key.name):
            table = getattr(self, attribute)
            address = change.address.key if change.key is FACT else astuple(change.address)
            at = address if len(address) > 1 else address[0]
            if change.value is None:
                table.pop(at, None)
            else:
                table[at] = change.value
        self.changed.set()

    @property
    def now_s(self) -> float | None:
        """The fleet's clock, where a simulation publishes it; else the latest time on a key."""
        if self.clock is not None:
            return self.clock.time_s
        times = [state.time_s for state in self.robot_states.values()]
        times += [status.time_s for status in self.plan_status.values()]
        return max(times, default=None)

    @property
    def wanted(self) -> dict[str, Goal]:
        """What people want, by name: as goals, and as schedules."""
        scheduled = {name: schedule.goal for name, schedule in self.schedules.items()}
        return scheduled | self.goals

    def runs(self) -> list[str]:
        """The goals that goals have made, and that have not ended."""
        return [
            name
            for name, status in self.goal_status.items()
            if status.part_of is not None and status.state not in ENDED_GOALS
        ]

    def records(self, plan: str) -> dict[str, TaskRecord]:
        """The records of a plan's tasks, by task."""
        return {task: record for (of, task), record in self.tasks.items() if of == plan}

    def standing_closures(self) -> list[Closure]:
        """What is closed now."""
        now_s = self.now_s or 0.0
        return [each for _, each in sorted(self.closures.items()) if not each.is_over(now_s)]

    def held_by(self, stop: Stop) -> list[str]:
        """The registered robots that a stop holds still."""
        return [r for r in sorted(self.robot_specs) if stop.holds(r, self.stop_releases)]

    def changed_s(self, plan: str) -> float:
        """When a plan last changed, as far as its status says (0: no status)."""
        status = self.plan_status.get(plan)
        return status.time_s if status else 0.0

    def ended(self, goals: tuple[str, ...]) -> bool:
        """Whether the planner has given its last word on every one of `goals`."""
        return all(
            goal in self.goal_status and self.goal_status[goal].state in ENDED_GOALS
            for goal in goals
        )

    def stands(self, goal: str) -> bool:
        """Whether a goal is kept, or repeated, until somebody deletes it, and nothing goes on."""
        status = self.goal_status.get(goal)
        return status is not None and status.state is GoalState.STANDING and not status.parts

    async def until(
        self, condition: Callable[[], bool], timeout_s: float, waiting_for: str
    ) -> None:
        """Return as soon as `condition` holds.

        Raises:
            TooLate: it did not within `timeout_s` [s]; the message says what was waited for.
        """
        try:
            async with asyncio.timeout(timeout_s):
                while not condition():
                    if self.failure is not None:
                        raise self.failure
                    self.changed.clear()
                    await self.changed.wait()
        except TimeoutError:
            raise TooLate(f"waited {timeout_s:g} s for {waiting_for}, in vain") from None

    async def until_read(
        self, goals: tuple[str, ...], what: str, planner_s: float, model_s: float
    ) -> None:
        """Return as soon as each goal has been read: by the planner's grammar, else by a model.

        Raises:
            TooLate: one had not; the message names `what` was to be read.
        """
        status = self.goal_status
        await self.until(
            lambda: all(goal in status for goal in goals), planner_s, f"the planner to read {what}"
        )
        await self.until(
            lambda: all(status[goal].state is not GoalState.READING for goal in goals),
            model_s,
            f"a language model to read {what}",
        )

    async def forever(self) -> NoReturn:
        """Return only by cancellation, or by what goes wrong in the background."""
        while self.failure is None:
            self.changed.clear()
            await self.changed.wait()
        raise self.failure


@asynccontextmanager
async def fleet_view(
    session: Session, *keys: Any, on_change: Callable[[Change[Any, Any]], None] | None = None
) -> AsyncIterator[FleetView]:
    """A view that is kept current in the background; at entry all that is stored is in it.

    `on_change` hears of each change before it is on the view. An error in the background is
    raised by `FleetView.until`.

    Raises:
        Unreachable: the store did not list what it has.
    """
    view = FleetView()
    async with session.watch(*keys) as watch:

        async def follow() -> None:
            try:
                async for change in watch:
                    if on_change is not None:
                        on_change(change)
                    view.apply(change)
            except Exception as error:
                view.failure = error
                view.changed.set()

        follower = asyncio.create_task(follow())
        try:
            await _synced(watch)
            yield view
        finally:
            follower.cancel()
            await asyncio.wait([follower])


async def snapshot(session: Session, *keys: Any) -> FleetView:
    """What is stored now under these keys.

    Raises:
        Unreachable: the store did not list what it has.
    """
    async with fleet_view(session, *keys) as view:
        return view


async def _synced(watch: Watch) -> None:
    """Wait until all that is stored is on the view.

    Once it was handed to the iterator the follower, which was woken first, drains it before this
    task runs on.
    """
    try:
        async with asyncio.timeout(SYNC_S):
            await watch.synced()
    except TimeoutError:
        raise Unreachable(f"the store did not list what it has within {SYNC_S:g} s") from None
