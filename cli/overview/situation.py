"""What of a fleet is of interest to whoever looks at it, in the order in which it is."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import msgspec
from msgspec.structs import replace

from cli.client.order_waits import order_key, waits_of_order
from keyexpr_schema.ids import natural_order
from keyexpr_schema.payloads.closures import Closure
from keyexpr_schema.payloads.goals import ENDED_GOALS, GoalState, GoalStatus
from keyexpr_schema.payloads.holds import Hold
from keyexpr_schema.payloads.plans import ENDED_PLANS, PlanStatus
from keyexpr_schema.payloads.robots import RobotState
from keyexpr_schema.payloads.system import UndecodableValue
from keyexpr_schema.payloads.tasks import ENDED_TASKS, TaskRecord, TaskState
from keyexpr_schema.payloads.waits import WaitKind, WaitReason

if TYPE_CHECKING:
    from cli.client.fleet_view import FleetView
    from cli.client.health import Health

WORD_OF = frozenset({WaitKind.APPROVAL, WaitKind.START})
"""What a person says of a plan before it is carried out."""
ASKED = frozenset({WaitKind.QUESTION, WaitKind.CONFIRMATION})
GONE = frozenset({WaitKind.AWAY, WaitKind.LOST})


class Waiting(msgspec.Struct, frozen=True, kw_only=True):
    """A goal, or a task that is next (`PLAN/TASK`), and what it waits for."""

    what: str
    state: str
    waits_for: tuple[WaitReason, ...]
    robot: str | None = None
    stands: str | None = None
    """What a goal stands for that waits for nothing in particular."""


@dataclass(frozen=True)
class Filters:
    """What alone is of interest; nothing named: everything."""

    robots: frozenset[str] = frozenset()
    goals: frozenset[str] = frozenset()
    plans: frozenset[str] = frozenset()

    @classmethod
    def of(
        cls,
        robots: Iterable[str] | None = None,
        goals: Iterable[str] | None = None,
        plans: Iterable[str] | None = None,
    ) -> Filters:
        """Those of a command line."""
        return cls(frozenset(robots or ()), frozenset(goals or ()), frozenset(plans or ()))

    def admit(self, what: object) -> bool:
        """Whether they let what is published of a task, a goal or a plan through."""
        if not self.any:
            return True
        match what:
            case TaskRecord():
                robots = {what.robot, *what.args.values(), *(w.robot for w in what.waits_for)}
                by_name = what.plan in self.plans or what.goal in self.goals
                return by_name or bool(self.robots & robots)
            case PlanStatus():
                robots = {*what.allocation.values()}
                by_name = what.plan in self.plans or bool(self.goals & {*what.goals})
                return by_name or bool(self.robots & robots)
            case GoalStatus():
                plans = {what.plan, *(reason.plan for reason in what.waits_for)}
                by_name = what.goal in self.goals or what.part_of in self.goals
                return by_name or bool(self.plans & plans)
        return False

    def admits_robot(self, robot: str) -> bool:
        """Whether they let what is said of a robot through."""
        return not self.any or robot in self.robots

    @property
    def any(self) -> bool:
        """Whether something is left out."""
        return bool(self.robots or self.goals or self.plans)


@dataclass(frozen=True)
class Situation:
    """A view of the fleet, as far as the filters let it through.

    `health`: who is there, and what is wrong; `None`: nobody has asked.
    """

    view: FleetView
    filters: Filters = Filters()
    health: Health | None = None

    def is_away(self, robot: str) -> bool:
        """Whether a robot's worker is not connected."""
        return self.health is not None and robot not in self.health.connected

    @cached_property
    def tasks(self) -> list[TaskRecord]:
        """Tasks that have not ended, by plan; those that are ordered with what their robots say
        that they wait for."""
        rejects = self.health.undecodable if self.health is not None else ()
        kept = [
            replace(r, waits_for=waits_of_order(r, self.view.robot_states, rejects))
            for r in self.view.tasks.values()
            if r.state not in ENDED_TASKS and self.filters.admit(r)
        ]
        return sorted(kept, key=lambda r: (natural_order(r.plan), natural_order(r.task)))

    @cached_property
    def unreadable(self) -> list[UndecodableValue]:
        """Values that nobody can read; where not everything is wanted, orders of these tasks."""
        found = self.health.undecodable if self.health is not None else ()
        if not self.filters.any:
            return list(found)
        orders = {order_key(record) for record in self.running}
        return [each for each in found if each.keyexpr in orders]

    @cached_property
    def running(self) -> list[TaskRecord]:
        """Tasks that a robot has an order for."""
        return [record for record in self.tasks if record.state is not TaskState.WAITING]

    @cached_property
    def plans(self) -> list[PlanStatus]:
        """Plans that are made or carried out; those that wait for a person need one."""
        return [status for status in self.unended if not WORD_OF & _kinds(status)]

    @cached_property
    def unended(self) -> list[PlanStatus]:
        """Plans that have not ended."""
        return [status for status in self.every_plan if status.state not in ENDED_PLANS]

    @cached_property
    def goals(self) -> list[GoalStatus]:
        """Goals in the order in which they were given; one that nobody has read waits."""
        names = {**dict.fromkeys(self.view.wanted), **dict.fromkeys(self.view.goal_status)}
        unread = (GoalStatus(goal=goal, state=GoalState.WAITING) for goal in names)
        found = [self.view.goal_status.get(each.goal, each) for each in unread]
        return sorted(filter(self._is_goal_shown, found), key=self._in_order)

    @cached_property
    def holds(self) -> list[Hold]:
        """Pauses and drains, but of plans that are over."""
        holds = sorted(self.view.holds.values(), key=lambda hold: hold.hold)
        holds = [hold for hold in holds if not hold.plans or any(map(self._goes_on, hold.plans))]
        return [
            hold
            for hold in holds
            if not self.filters.any
            or hold.of_all
            or self.filters.robots & {*hold.robots}
            or self.filters.plans & {*hold.plans}
        ]

    def _goes_on(self, plan: str) -> bool:
        status = self.view.plan_status.get(plan)
        return status is not None and status.state not in ENDED_PLANS

    @cached_property
    def closures(self) -> list[Closure]:
        """Places, doors and zones that are closed to some or all robots."""
        return [] if self.filters.goals or self.filters.plans else self.view.standing_closures()

    @cached_property
    def waiting(self) -> list[Waiting]:
        """Goals, but those that are listed as schedules, and the tasks that wait for something else
        than other tasks."""
        goals = [
            Waiting(what=s.goal, state=s.state.value, waits_for=s.waits_for, stands=_stands(s))
            for s in self.goals
            if s.state is not GoalState.RUNNING
            and s.goal not in self.view.schedules
            and (self.filters.any or s.goal not in self.view.schedule_status)
            and s.state not in ENDED_GOALS
            and not ASKED & _kinds(s)
        ]
        return goals + [
            Waiting(
                what=f"{record.plan}/{record.task}",
                state=record.state.value,
                waits_for=record.waits_for,
                robot=record.robot,
            )
            for record in self.tasks
            if record.state is TaskState.WAITING
            and record.waits_for
            and all(reason.kind is not WaitKind.TASK for reason in record.waits_for)
        ]

    @cached_property
    def behind(self) -> int:
        """How many tasks wait for others."""
        return sum(record.state is TaskState.WAITING for record in self.tasks) - sum(
            each.robot is not None for each in self.waiting
        )

    @cached_property
    def robots(self) -> list[tuple[str, str, RobotState | None]]:
        """Each robot, what it is at in a word, and what it says of itself."""
        view = self.view
        known = {
            *view.robot_specs,
            *view.robot_states,
            *(self.health.connected if self.health else ()),
        }
        names = sorted(known, key=natural_order)
        shown = self.filters.robots or not self.filters.any
        wanted = [
            n for n in names if shown and (not self.filters.robots or n in self.filters.robots)
        ]
        return [(name, self._activity(name), view.robot_states.get(name)) for name in wanted]

    def ended(self) -> tuple[list[GoalStatus], list[PlanStatus]]:
        """Goals and plans that are over, the newest first."""
        goals = [
            status
            for status in self.goals
            if status.state in ENDED_GOALS and not ASKED & _kinds(status)
        ]
        plans = [status for status in self.every_plan if status.state in ENDED_PLANS]
        return (
            sorted(goals, key=lambda s: -(s.wall_time_s or s.time_s)),
            sorted(plans, key=lambda s: -(s.wall_time_s or s.time_s)),
        )

    def counted(self, plan: str) -> tuple[int, int]:
        """How many of a plan's tasks are done, and how many there are."""
        states = Counter(record.state for record in self.view.records(plan).values())
        return states[TaskState.SUCCEEDED], states.total() - states[TaskState.CANCELLED]

    def reached(self, status: PlanStatus) -> tuple[int, int]:
        """How many of a plan's goals are reached, and how many there are."""
        known = (self.view.goal_status.get(goal) for goal in status.goals)
        done = sum(each is not None and each.state is GoalState.REACHED for each in known)
        return done, len(status.goals)

    # --- what is let through ---------------------------------------------------------------------

    @cached_property
    def every_plan(self) -> list[PlanStatus]:
        """Plans that have not ended, and those whose keys are still there."""
        statuses = self.view.plan_status
        found = [statuses[name] for name in sorted(statuses, key=natural_order)]
        return [status for status in found if self.filters.admit(status)]

    def _is_goal_shown(self, status: GoalStatus) -> bool:
        plan = self.view.plan_status.get(status.plan or "")
        robots = {*plan.allocation.values()} if plan is not None else set()
        return self.filters.admit(status) or bool(self.filters.robots & robots)

    def _in_order(self, status: GoalStatus) -> tuple[int, tuple[object, ...]]:
        spec = self.view.goals.get(status.goal)
        return (spec.ordinal if spec else 0, tuple(natural_order(status.goal)))

    def _activity(self, robot: str) -> str:
        state = self.view.robot_states.get(robot)
        if self.is_away(robot):
            return "away"
        if robot not in self.view.robot_specs:
            return "not registered"
        if state is None:
            return "nothing heard"
        return "emergency stop" if state.stops else state.activity.value


def _stands(status: GoalStatus) -> str | None:
    if status.state is not GoalState.STANDING:
        return None
    if status.whenever:
        return f"it stands by, whenever {' and '.join(map(str, status.whenever))}"
    return status.reason or "it is kept until somebody deletes it"


def _kinds(status: GoalStatus | PlanStatus) -> frozenset[WaitKind]:
    return frozenset(reason.kind for reason in status.waits_for)
