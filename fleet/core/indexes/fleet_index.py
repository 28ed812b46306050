"""What is derived from the state as a whole, so that an event need not walk through it.

`fleet.core.state_updates` keeps it up; `index_of` derives it anew. Both come to the same, which is
a test.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from math import inf
from typing import TypeVar

import immutables
import msgspec

from fleet.core.indexes.plan_index import robots_of
from fleet.core.plan_entry import PlanEntry
from fleet.core.table import Table
from keyexpr_schema.facts import AT, IN, ON, FactKey
from keyexpr_schema.payloads.goals import ENDED_GOALS, Goal, GoalState, GoalStatus
from keyexpr_schema.payloads.world import Fact, Object

Names = immutables.Map[str, None]
"""A set of names. It has no order: nothing may depend on how it is walked through."""
EMPTY: Names = immutables.Map()
Sets = immutables.Map[str, Names]
Variables = immutables.Map[FactKey, None]
S = TypeVar("S")
M = TypeVar("M")
Order = tuple[str, str]
"""A plan and one of its tasks."""
Orders = immutables.Map[Order, None]
NO_ORDERS: Orders = immutables.Map()


class FleetIndex(msgspec.Struct, frozen=True, eq=False):
    """Who does what, and what is about whom.

    `active` has the plans that have not ended, with the priority in which their tasks get robots.
    `work` has, by robot, the orders that may be carried out with it, `things_at` the subjects of
    `at` facts by value, `said_on` the variables of facts that say `on` or `in`, `parts` things by
    what they are parts of, `goals_about` the goals that have not ended by the subjects of their
    conditions, `goals_watching` goals by the subjects of what may hold on the way to them and of
    what has to hold before, `plans_of` the active plans by goal. `in_state` has the goals that no
    plan works on. Of those none is due before `wakes_s`, on the fleet's clock.
    `job_of` has the plans by the number of their planning job, `asked` by the requests
    that are in work for them, `dropping` those that have tasks which they do without. `team` are
    the robots that can be planned with.
    """

    active: Table[str, int] = Table()
    work: immutables.Map[str, Orders] = immutables.Map()
    things_at: Sets = immutables.Map()
    said_on: immutables.Map[str, Variables] = immutables.Map()
    parts: Sets = immutables.Map()
    goals_about: Sets = immutables.Map()
    goals_watching: Sets = immutables.Map()
    plans_of: immutables.Map[str, tuple[str, ...]] = immutables.Map()
    in_state: immutables.Map[GoalState, Names] = immutables.Map()
    job_of: immutables.Map[int, str] = immutables.Map()
    asked: Sets = immutables.Map()
    dropping: Names = EMPTY
    team: Names = EMPTY
    wakes_s: float = inf

    def __eq__(self, other: object) -> bool:
        # Derived: two states that are otherwise equal have equal indexes.
        return isinstance(other, FleetIndex)

    __hash__ = None  # type: ignore[assignment]


def in_set(
    sets: immutables.Map[S, immutables.Map[M, None]], name: S, member: M, there: bool
) -> immutables.Map[S, immutables.Map[M, None]]:
    """The sets, with `member` in that of `name` or not."""
    known = sets.get(name) or immutables.Map()
    if (member in known) == there:
        return sets
    if there:
        return sets.set(name, known.set(member, None))
    rest = known.delete(member)
    return sets.set(name, rest) if rest else sets.delete(name)


def carrier_in(fact: Fact | None) -> str | None:
    """What carries its subject directly, as a fact says: a place, a thing, a robot."""
    if fact is None or fact.relation != AT or not isinstance(fact.value, str):
        return None
    return fact.value


def rest_in(fact: Fact | None) -> str | None:
    """What its subject is on or in, as a fact says that is none of `at`."""
    if fact is None or fact.relation not in (ON, IN) or not isinstance(fact.value, str):
        return None
    return fact.value


def carried_by(index: FleetIndex, name: str) -> Iterator[str]:
    """`name`, its parts, and what is there, on or in them, however indirectly."""
    seen, open_ = {name}, [name]
    while open_:
        carrier = open_.pop()
        yield carrier
        for found in (index.things_at, index.parts):
            more = [name for name in found.get(carrier, EMPTY) if name not in seen]
            seen.update(more)
            open_.extend(more)


def watched_subjects(goal: Goal | None) -> frozenset[str]:
    """What a goal waits for, and what must always, never, or not yet hold for it, is about."""
    if goal is None:
        return frozenset()
    rows = (*goal.when, *goal.only_if, *goal.whenever)
    waits = frozenset(name for row in rows for name in row.subjects)
    return waits | constrained_subjects(goal)


def constrained_subjects(goal: Goal | None) -> frozenset[str]:
    """What must always, never, or not yet hold for a goal is about."""
    rows = () if goal is None else goal.constraints
    return frozenset(subject for condition in rows for subject in condition.subjects)


def subjects_of(status: GoalStatus | None) -> frozenset[str]:
    """What the conditions of a goal that has not ended are about."""
    if status is None or status.state in ENDED_GOALS:
        return frozenset()
    return frozenset(subject for c in status.conditions for subject in c.subjects)


UNPLANNED = frozenset(
    {GoalState.WAITING, GoalState.REJECTED, GoalState.PENDING, GoalState.STANDING}
)
"""States of goals that are listed."""


def priority_of(entry: PlanEntry, goals: Mapping[str, Goal]) -> int:
    """The highest priority of a plan's goals; 0 where it has none."""
    return max((goals[goal].priority for goal in entry.plan.goals if goal in goals), default=0)


def requests_of(entry: PlanEntry | None) -> frozenset[str]:
    """The requests that are in work for a plan."""
    if entry is None:
        return frozenset()
    found = {wish.request for wish in entry.wishes}
    if entry.job is not None:
        found.add(entry.job.request)
    return frozenset(request for request in found if request is not None)


def job_of(entry: PlanEntry | None) -> int | None:
    """The number of a plan's planning job."""
    return None if entry is None or entry.job is None else entry.job.job


def index_of(
    plans: Mapping[str, PlanEntry],
    goals: Mapping[str, Goal],
    goal_states: Mapping[str, GoalStatus],
    facts: Mapping[FactKey, Fact],
    objects: Mapping[str, Object],
    team: Iterable[str],
) -> FleetIndex:
    """The index of these plans, goals and facts, derived anew."""
    work: dict[str, dict[Order, None]] = {}
    plans_of: dict[str, list[str]] = {}
    asked: Sets = immutables.Map()
    for plan, entry in plans.items():
        for request in requests_of(entry):
            asked = in_set(asked, request, plan, True)
        for record in entry.outstanding():
            for robot in robots_of(record):
                work.setdefault(robot, {})[plan, record.task] = None
        if not entry.ended:
            for goal in entry.wanted_goals:
                plans_of.setdefault(goal, []).append(plan)
    things_at: Sets = immutables.Map()
    said_on: immutables.Map[str, Variables] = immutables.Map()
    parts: Sets = immutables.Map()
    for thing in objects.values():
        if thing.part_of is not None:
            parts = in_set(parts, thing.part_of, thing.object, True)
    for fact in facts.values():
        if (carrier := carrier_in(fact)) is not None:
            things_at = in_set(things_at, carrier, fact.subject, True)
        if (rest := rest_in(fact)) is not None:
            said_on = in_set(said_on, rest, fact.key, True)
    goals_about: Sets = immutables.Map()
    goals_watching: Sets = immutables.Map()
    for name, spec in goals.items():
        for subject in watched_subjects(spec):
            goals_watching = in_set(goals_watching, subject, name, True)
    in_state: immutables.Map[GoalState, Names] = immutables.Map()
    for goal, status in goal_states.items():
        if status.state in UNPLANNED:
            in_state = in_set(in_state, status.state, goal, True)
        for subject in subjects_of(status):
            goals_about = in_set(goals_about, subject, goal, True)
    return FleetIndex(
        active=Table({p: priority_of(e, goals) for p, e in plans.items() if not e.ended}),
        work=immutables.Map({robot: Orders(orders) for robot, orders in work.items()}),
        things_at=things_at,
        said_on=said_on,
        parts=parts,
        goals_about=goals_about,
        goals_watching=goals_watching,
        plans_of=immutables.Map({goal: tuple(names) for goal, names in plans_of.items()}),
        in_state=in_state,
        job_of=immutables.Map({e.job.job: p for p, e in plans.items() if e.job is not None}),
        asked=asked,
        dropping=immutables.Map({p: None for p, e in plans.items() if e.unwanted}),
        team=immutables.Map(dict.fromkeys(team)),
        wakes_s=min((s.next_s for s in goal_states.values() if s.next_s is not None), default=inf),
    )


NO_FLEET = FleetIndex()
"""That of a state that knows nothing."""
