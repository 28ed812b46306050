"""Everything that can happen to the planner. Events are journaled, and a journal replays."""

from __future__ import annotations

from collections.abc import Mapping
from functools import reduce
from operator import or_
from typing import Any

import msgspec

from fleet.core.model.skills import SkillModel
from fleet.core.model.time_zones import Offsets
from fleet.core.plan_entry import PlanOutcome
from fleet.core.state import Policy
from keyexpr_schema.payloads.closures import Closure
from keyexpr_schema.payloads.durations import Durations
from keyexpr_schema.payloads.goals import Condition, Goal, GoalStatus
from keyexpr_schema.payloads.holds import Hold
from keyexpr_schema.payloads.plans import Plan, Violation
from keyexpr_schema.payloads.requests import Answer, ControlRequest, PlanRequest, ReplanRequest
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.schedules import Schedule
from keyexpr_schema.payloads.stops import Stop, StopRelease
from keyexpr_schema.payloads.tasks import Order, Report
from keyexpr_schema.payloads.world import Fact, Object, Place, Statement, StatementStatus

At = Mapping[str, Any]
"""When an event happened, as its fields `time_s`, `wall_time_s` and `monotonic_s`."""


class Event(msgspec.Struct, frozen=True, kw_only=True, tag_field="event", tag=True):
    """Base of every event: when it happened on the fleet's clock [s] and in Unix time [s].

    `monotonic_s` is a clock of the planner's host that nobody sets [s]; it begins anew with each
    run of the planner. `None` in journals of before: there Unix time stands in for it.
    """

    time_s: float
    wall_time_s: float
    monotonic_s: float | None = None


class PlannerStarted(Event, frozen=True, kw_only=True):
    """A run of the planner begins; its epoch is higher than that of any run before.

    It brings all that decides how events are handled from here on: the policy, the skill models,
    and the number of the core's logic (`fleet.core.state.LOGIC`). Journals from before that leave
    the skills to whoever replays them. `lineage` is new in the first run over a journal.
    """

    epoch: int
    incarnation: str
    policy: Policy = Policy()
    skills: dict[str, SkillModel] | None = None
    logic: int = 0
    lineage: str = ""


class EpochRaised(Event, frozen=True, kw_only=True):
    """The run goes on with a higher epoch: robots have had orders of one that was not known of."""

    epoch: int


class GoalPut(Event, frozen=True, kw_only=True):
    """A goal was put."""

    goal: Goal


class GoalDeleted(Event, frozen=True, kw_only=True):
    """A goal was deleted."""

    goal: str


class SchedulePut(Event, frozen=True, kw_only=True):
    """A schedule was put."""

    schedule: Schedule


class ScheduleDeleted(Event, frozen=True, kw_only=True):
    """A schedule was deleted."""

    schedule: str


class TimeZoneRead(Event, frozen=True, kw_only=True):
    """The rules of a time zone that somebody speaks of, as the planner's host has them."""

    zone: str
    offsets: Offsets


class FactPut(Event, frozen=True, kw_only=True):
    """A fact was put; `received` orders what the store has received [µs], 0 where it is not
    known."""

    fact: Fact
    received: int = 0


class FactDeleted(Event, frozen=True, kw_only=True):
    """A fact was deleted."""

    subject: str
    relation: str


class StatementPut(Event, frozen=True, kw_only=True):
    """A statement was put; `received` as in `FactPut`."""

    statement: Statement
    received: int = 0


class StatementDeleted(Event, frozen=True, kw_only=True):
    """A statement was deleted."""

    statement: str


class PlacePut(Event, frozen=True, kw_only=True):
    """A place was put."""

    place: Place


class PlaceDeleted(Event, frozen=True, kw_only=True):
    """A place was deleted."""

    place: str


class ObjectPut(Event, frozen=True, kw_only=True):
    """An object was put."""

    object: Object


class ObjectDeleted(Event, frozen=True, kw_only=True):
    """An object was deleted."""

    object: str


class RobotRegistered(Event, frozen=True, kw_only=True):
    """A robot was registered."""

    spec: RobotSpec


class RobotUnregistered(Event, frozen=True, kw_only=True):
    """A robot was unregistered."""

    robot: str


class StopPut(Event, frozen=True, kw_only=True):
    """Somebody gave an emergency stop."""

    stop: Stop


class StopDeleted(Event, frozen=True, kw_only=True):
    """An emergency stop is over."""

    stop: str


class StopReleased(Event, frozen=True, kw_only=True):
    """An emergency stop holds this robot no longer."""

    release: StopRelease


class StopReleaseDeleted(Event, frozen=True, kw_only=True):
    """A release is gone: with its stop, or by itself."""

    stop: str
    robot: str


class HoldPut(Event, frozen=True, kw_only=True):
    """Somebody paused or drained something."""

    hold: Hold


class HoldDeleted(Event, frozen=True, kw_only=True):
    """A pause or drain is over."""

    hold: str


class ClosurePut(Event, frozen=True, kw_only=True):
    """Somebody closed a part of the floor."""

    closure: Closure


class ClosureDeleted(Event, frozen=True, kw_only=True):
    """A part of the floor is open again."""

    closure: str


class WorkerConnected(Event, frozen=True, kw_only=True):
    """A run of a robot's worker is there; `incarnation` names the run."""

    robot: str
    incarnation: str


class WorkerDisconnected(Event, frozen=True, kw_only=True):
    """That run of the robot's worker is no longer there."""

    robot: str
    incarnation: str


class ReportReceived(Event, frozen=True, kw_only=True):
    """A worker reported on an attempt; `received` as in `FactPut`, of when it was to be sent."""

    report: Report
    received: int = 0


class PlanRequested(Event, frozen=True, kw_only=True):
    """Someone wants a plan."""

    request: PlanRequest


class ReplanRequested(Event, frozen=True, kw_only=True):
    """Someone wants a plan made again."""

    request: ReplanRequest


class ControlRequested(Event, frozen=True, kw_only=True):
    """Someone wants a plan started, approved, cancelled, deleted or extended."""

    request: ControlRequest


class PlanProposed(Event, frozen=True, kw_only=True):
    """Someone put a plan of their own."""

    plan: Plan


class PlanningSucceeded(Event, frozen=True, kw_only=True):
    """A planning job ended with a checked and allocated plan.

    `durations_s` and `extra_after` are by task, `sequence` lists each robot's actors in order.
    `repaired` says that the residual plan goes on, perhaps with goals planned anew beside it,
    `left_out` which goals the plan does without since they cannot be reached, and why, `postponed`
    those that can be reached later, `not_in_time` the ones of these for which only the time did not
    suffice, `for_robots` those that a robot which is not connected could help with.
    """

    job: int
    plan: Plan
    allocation: dict[str, str]
    sequence: dict[str, tuple[str, ...]]
    extra_after: dict[str, tuple[str, ...]]
    durations_s: dict[str, float]
    predicted_makespan_s: float = msgspec.field(name="makespan_s")
    planning_time_s: float
    lower_bound_s: float | None = None
    mission_bound_s: float | None = None
    notes: tuple[str, ...] = ()
    repaired: bool = msgspec.field(default=False, name="mended")
    left_out: dict[str, str] = {}
    postponed: dict[str, str] = {}
    not_in_time: tuple[str, ...] = ()
    for_robots: dict[str, str] = {}

    @property
    def outcome(self) -> PlanOutcome:
        """What allocation came to."""
        return msgspec.convert(self, PlanOutcome, from_attributes=True)


class PlanningFailed(Event, frozen=True, kw_only=True):
    """A planning job ended without a plan.

    `postponed`: nothing is known against one, only the time (or the process) did not suffice.
    `for_robots`: the goals for which there would be one if all robots were connected.
    `goal_reasons` are those of goals that have one of their own.
    """

    job: int
    reason: str
    violations: tuple[Violation, ...] = ()
    planning_time_s: float = 0.0
    postponed: bool = False
    for_robots: tuple[str, ...] = ()
    goal_reasons: dict[str, str] = {}

    def reason_for(self, goal: str) -> str:
        """Why there is no plan for this goal."""
        return self.goal_reasons.get(goal, self.reason)


class GoalInterpreted(Event, frozen=True, kw_only=True):
    """A language model was asked about a goal's sentence: how it says it, or why it does not."""

    goal: str
    text: str | None = None
    """The sentence; the goal may have another one by now."""
    paraphrase: str | None = None
    """The same in sentences that the grammar reads."""
    teaches: str | None = None
    """The entry of a task file by which the grammar would read it [YAML]."""
    stages: tuple[tuple[Condition, ...], ...] = ()
    """What it means, as models of earlier versions have said."""
    reason: str | None = None


class PriorStateLoaded(Event, frozen=True, kw_only=True):
    """What an earlier planner left in the store was read by one that has no journal of it."""

    answers: tuple[Answer, ...] = ()
    goals: tuple[GoalStatus, ...] = ()
    plans: tuple[str, ...] = ()
    orders: tuple[Order, ...] = ()
    """They may still be carried out."""
    statements: tuple[StatementStatus, ...] = ()
    """What an earlier planner had read out of statements; only what is said anew is read again."""
    durations: tuple[Durations, ...] = ()


class TimerFired(Event, frozen=True, kw_only=True):
    """A timer that the state asked for has run out."""


_TAG_FIRST = b'{"event":"'
"""How a line begins: msgspec writes the tag first."""
# fmt: off
_OLD_TAGS = {
    b"GoalTold": b"GoalPut", b"GoalForgotten": b"GoalDeleted",
    b"FactTold": b"FactPut", b"FactForgotten": b"FactDeleted",
    b"StatementTold": b"StatementPut", b"StatementForgotten": b"StatementDeleted",
    b"PlaceTold": b"PlacePut", b"PlaceForgotten": b"PlaceDeleted",
    b"ObjectTold": b"ObjectPut", b"ObjectForgotten": b"ObjectDeleted",
    b"RobotTold": b"RobotRegistered", b"RobotForgotten": b"RobotUnregistered",
    b"RobotSeen": b"WorkerConnected", b"RobotGone": b"WorkerDisconnected",
    b"ReportTold": b"ReportReceived", b"PlanAsked": b"PlanRequested",
    b"ReplanAsked": b"ReplanRequested", b"ControlAsked": b"ControlRequested",
    b"PlanMade": b"PlanningSucceeded", b"PlanNotMade": b"PlanningFailed",
    b"Remembered": b"PriorStateLoaded", b"TimePassed": b"TimerFired",
}
# fmt: on
"""Tags in journals of earlier versions, and what they are called now."""

_DECODER: msgspec.json.Decoder[Event] = msgspec.json.Decoder(reduce(or_, Event.__subclasses__()))


def encode_event(event: Event) -> bytes:
    """An event as one line of JSON."""
    return msgspec.json.encode(event)


def decode_event(data: bytes) -> Event:
    """The event in a line of JSON, of this or an earlier version.

    Raises:
        msgspec.ValidationError: it is not one.
    """
    tag, _, rest = data.removeprefix(_TAG_FIRST).partition(b'"')
    if (new := _OLD_TAGS.get(tag)) is not None:
        data = b'%b%b"%b' % (_TAG_FIRST, new, rest)
    return _DECODER.decode(data)
