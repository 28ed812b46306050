"""Whose reasons to wait an event may have changed: looked up in indexes, from what it touched.

A task that waits for others has new reasons when one of these has succeeded. One that waits for
robots only is in the ready set of its plan, by each robot that it needs: what happens to a robot
concerns those, in every plan. What is named here too often costs a comparison, and no more.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from fleet.core.indexes.fact_views import FactValues
from fleet.core.indexes.fleet_index import subjects_of
from fleet.core.indexes.plan_index import robots_of
from fleet.core.indexes.touches import Part, Touch
from fleet.core.model.derived import carriers
from fleet.core.plan_entry import PlanEntry
from fleet.core.state import State
from keyexpr_schema.facts import AT, CHARGE
from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.payloads.plans import PlanState
from keyexpr_schema.payloads.tasks import TaskState


@dataclass
class WaitsTouched:
    """Tasks by plan, and goals, that may wait for something else now; both ordered."""

    tasks: dict[str, dict[str, None]] = field(default_factory=dict)
    goals: dict[str, None] = field(default_factory=dict)

    @classmethod
    def of(cls, old: State, new: State, touches: Iterable[Touch]) -> WaitsTouched:
        """What these touches, on the way from one state to the other, may have changed."""
        found = cls()
        robots = dict.fromkeys(_held_up_otherwise(old, new))
        facts, moved = False, old.closures is not new.closures
        for part, name, task in touches:
            match part:
                case Part.TEAM:
                    moved = True
                case Part.ROBOT:
                    robots[name] = None
                    moved = moved or (name in old.index.team) != (name in new.index.team)
                case Part.RECORD:
                    robots |= dict.fromkeys(found._record(old, new, name, task))
                case Part.RECORDS:
                    robots |= dict.fromkeys(_working(old.plans.get(name), new.plans.get(name)))
                case Part.PLAN:
                    robots |= dict.fromkeys(found._plan(old, new, name))
                case Part.GOAL:  # a robot that is to charge does nothing else until it has
                    for state in (old, new):
                        about = subjects_of(state.goal_states.get(name))
                        robots |= dict.fromkeys(about)
                        for subject in about:  # what others may wait for
                            found._goals_named(state.index.goals_watching.get(subject, ()))
                case Part.FACT:
                    facts = True
                    moved = moved or name.relation == AT
                    if name.relation == CHARGE:  # whose turn it is at a charger
                        found._all_ready(new)
                    if new.closures and name.subject in new.robots:  # ways begin where it stands
                        robots[name.subject] = None
        if facts:
            found._facts(old, new)
        if moved and (old.closures or new.closures):  # what is closed to all may be to some now
            for state in (old, new):
                found._goals_named(state.index.in_state.get(GoalState.WAITING, ()))
        for robot in robots:  # or places and things that tasks are about, too
            if _is_robot(old, robot) or _is_robot(new, robot):
                for state in (old, new):
                    found._robot(state, robot)
                    if _may_move_otherwise(old, new, robot):
                        found._at_work(state, robot)
        return found

    def _add(self, plan: str, tasks: Iterable[str]) -> None:
        self.tasks.setdefault(plan, {}).update(dict.fromkeys(tasks))

    def _goals_named(self, goals: Iterable[str]) -> None:
        self.goals.update(dict.fromkeys(sorted(goals)))

    def _ready(self, state: State, plan: str) -> None:
        if (entry := state.plans.get(plan)) is not None:
            for ready in entry.index.ready.values():
                self._add(plan, ready)

    def _all_ready(self, state: State) -> None:
        for plan in state.index.active:
            self._ready(state, plan)

    def _robot(self, state: State, robot: str) -> None:
        for plan in state.index.active:
            if ready := state.plans[plan].index.ready.get(robot):
                self._add(plan, ready)

    def _at_work(self, state: State, robot: str) -> None:
        for plan, task in state.index.work.get(robot, ()):
            self._add(plan, (task,))

    def _record(self, old: State, new: State, plan: str, task: str) -> frozenset[str]:
        """Whom a record is about that stands otherwise now."""
        before, after = old.plans.get(plan), new.plans.get(plan)
        was = before.records.get(task) if before is not None else None
        now = after.records.get(task) if after is not None else None
        if was is None or now is None:
            return frozenset().union(*(robots_of(r) for r in (was, now) if r is not None))
        if was.state is now.state:
            return frozenset()
        assert before is not None and after is not None
        for entry in (before, after):
            if TaskState.SUCCEEDED in (was.state, now.state):
                self._add(plan, entry.index.graph.successors.get(task, ()))
            skill = new.skills.get(now.skill)
            if task in entry.unwanted or (skill is not None and skill.recharges):
                self._all_ready(new)
        found = robots_of(now)
        return found if was.args is now.args else found | robots_of(was)

    def _plan(self, old: State, new: State, plan: str) -> Iterator[str]:
        """The plan's own ready tasks; and whom it has, or wants something of."""
        before, after = old.plans.get(plan), new.plans.get(plan)
        self._ready(old, plan)
        self._ready(new, plan)
        if _unwanted(before) != _unwanted(after):
            self._all_ready(new)
        if _is_made(before) != _is_made(after):  # what is planned by itself waits for that
            self._goals_named(new.waiting_for_robots)
        was, now = _goals(before), _goals(after)
        if was is not now:
            for goal in sorted({*was} ^ {*now}):
                self.goals[goal] = None
                for state in (old, new):
                    facts = FactValues(state.facts).get
                    for subject in subjects_of(state.goal_states.get(goal)):
                        yield subject
                        yield from carriers(subject, facts, state, aboard=True)
        if (plan in old.index.active) != (plan in new.index.active):
            yield from _reserved(before)
            yield from _reserved(after)

    def _facts(self, old: State, new: State) -> None:
        """Which tasks a new plan may do without, and which ones touch what is being cancelled, is
        read off the facts."""
        if old.index.dropping or new.index.dropping:
            self._all_ready(new)
            return
        for plan in new.index.active:
            if new.plans[plan].open_reasons:
                self._ready(new, plan)


def _is_robot(state: State, name: str) -> bool:
    """Whether it is a robot that is registered, or was."""
    return name in state.robots or name in state.gone_since


def _may_move_otherwise(old: State, new: State, robot: str) -> bool:
    """Whether a robot has come or gone, or there are other stops."""
    return (
        old.stops is not new.stops
        or old.released is not new.released
        or old.connected.get(robot) != new.connected.get(robot)
        or old.gone_wall_s.get(robot) != new.gone_wall_s.get(robot)
        or (robot in old.robots) != (robot in new.robots)
    )


def _held_up_otherwise(old: State, new: State) -> Iterator[str]:
    """Robots that other stops or pauses may hold, or other closures keep from places."""
    if old.closures is not new.closures:
        yield from new.robots
    if old.holds is not new.holds:
        for name in {**old.holds, **new.holds}:
            for state, hold in ((old, old.holds.get(name)), (new, new.holds.get(name))):
                if hold is not None and old.holds.get(name) != new.holds.get(name):
                    yield from _all_robots(state) if hold.of_all else hold.robots
    if old.stops is new.stops and old.released is new.released:
        return
    for name in {**old.stops, **new.stops}:
        was, now = old.stops.get(name), new.stops.get(name)
        if was == now:
            yield from {*old.released.get(name, ())} ^ {*new.released.get(name, ())}
            continue
        for state, stop in ((old, was), (new, now)):
            if stop is not None:
                yield from stop.robots or _all_robots(state)


def _all_robots(state: State) -> Iterator[str]:
    """Also those that are not registered any more: plans may still have them."""
    yield from state.robots
    yield from state.gone_since


def _working(old: PlanEntry | None, new: PlanEntry | None) -> Iterator[str]:
    """Robots that came to work for a plan, or to be reserved by it, or no longer are."""
    before: Mapping[str, None] = old.index.outstanding if old is not None else {}
    after: Mapping[str, None] = new.index.outstanding if new is not None else {}
    for entry, these, those in ((old, before, after), (new, after, before)):
        if entry is not None and these is not those:
            for task in these:
                if task not in those:
                    yield from robots_of(entry.records[task])
    was, now = {*_reserved(old)}, {*_reserved(new)}
    yield from sorted(was ^ now)


def _reserved(entry: PlanEntry | None) -> Iterable[str]:
    return () if entry is None else entry.index.reserved


def _unwanted(entry: PlanEntry | None) -> tuple[str, ...]:
    return () if entry is None else entry.unwanted


def _is_made(entry: PlanEntry | None) -> bool:
    return entry is not None and entry.state is PlanState.PLANNING


def _goals(entry: PlanEntry | None) -> tuple[str, ...]:
    return () if entry is None or entry.ended else entry.wanted_goals
