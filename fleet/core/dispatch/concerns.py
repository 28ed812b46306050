"""Whom a change concerns: which plans, goals, tasks and robots dispatch has to look at again."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field

from fleet.core.indexes.fact_views import FactValues
from fleet.core.indexes.fleet_index import EMPTY, carried_by, subjects_of
from fleet.core.indexes.plan_index import robots_of
from fleet.core.indexes.touches import Part, Touch
from fleet.core.model.derived import carriers
from fleet.core.own_waiting import KEPT_SINCE_LOGIC
from fleet.core.state import State
from keyexpr_schema.facts import AT, CHARGE, FactKey
from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.payloads.tasks import TaskRecord, TaskState

HELD = frozenset({GoalState.PENDING, GoalState.STANDING})
"""States of goals that no plan works on, and of which something may come."""
WATCHED_SINCE_LOGIC = 4
"""Since then, what must always, never, or not yet hold is looked at when it may have changed."""


@dataclass
class Concerns:
    """What may have come to be otherwise.

    `plans` are looked at as a whole; of others `goals` that may be reached and `tasks` that may be
    ready. `robots` may be free now; plans in `teams` may have more to work with. Of goals that no
    plan works on, `held` may be begun, or have more to make. Robots in `charges` may have to
    charge; goals that have `failed` may leave something in a hand. Of the planner's `own` goals,
    no plan may work on these any more.
    """

    plans: set[str] = field(default_factory=set)
    teams: set[str] = field(default_factory=set)
    goals: defaultdict[str, set[str]] = field(default_factory=lambda: defaultdict(set))
    tasks: defaultdict[str, set[str]] = field(default_factory=lambda: defaultdict(set))
    robots: set[str] = field(default_factory=set)
    held: set[str] = field(default_factory=set)
    charges: set[str] = field(default_factory=set)
    failed: set[str] = field(default_factory=set)
    own: set[str] = field(default_factory=set)

    @classmethod
    def of(cls, state: State, touches: Iterable[Touch]) -> Concerns:
        """What these changes concern."""
        found = cls()
        for part, name, task in touches:
            match part:
                case Part.TEAM:
                    found.teams.update(state.index.active)
                    found.charges.update(state.index.team)
                case Part.ROBOT:
                    found.robots.add(name)
                    found._robot(state, name)
                case Part.PLAN:
                    found._plan(state, name)
                case Part.RECORD:
                    found._record(state, name, task)
                case Part.GOAL:
                    found._goals(state, [name])
                    found._part(state, name)
                    status = state.goal_states.get(name)
                    if status is not None and status.state is GoalState.FAILED:
                        found.failed.add(name)
                    if status is not None and status.own:
                        found.own.add(name)
                case Part.FACT:
                    found._fact(state, name)
        return found

    def _robot(self, state: State, robot: str) -> None:
        """One that was drained or at work may have to charge now, or be given up for empty."""
        spec = state.robots.get(robot)
        if spec is not None and spec.battery is not None and state.logic >= KEPT_SINCE_LOGIC:
            self.charges.add(robot)

    def _plan(self, state: State, plan: str) -> None:
        entry = state.plans.get(plan)
        if entry is None:
            return
        self.plans.add(plan)
        if entry.ended:
            self.robots.update(entry.outcome.allocation.values())
            for goal in entry.plan.goals:
                for subject in subjects_of(state.goal_states.get(goal)):
                    facts = FactValues(state.facts)
                    self.robots.update(carriers(subject, facts.get, state, aboard=True))
                spec = state.goals.get(goal)
                if spec is not None and state.logic >= KEPT_SINCE_LOGIC:
                    self.robots.update(spec.by)  # who was to charge does other things again
        else:
            self.robots.update(entry.index.ready)

    def _record(self, state: State, plan: str, task: str) -> None:
        entry = state.plans.get(plan)
        record: TaskRecord | None = entry.records.get(task) if entry is not None else None
        if entry is None or record is None or task in entry.index.outstanding:
            return
        index = entry.index
        self.robots.update(robots_of(record))
        for robot in robots_of(record):
            self._robot(state, robot)
        if record.state is TaskState.WAITING:
            self.tasks[plan].add(task)
        elif record.state is TaskState.SUCCEEDED:
            self.tasks[plan].update(index.graph.successors.get(task, ()))
            if record.goal is not None and record.goal not in index.goal_open:
                self.goals[plan].add(record.goal)
        if state.logic >= WATCHED_SINCE_LOGIC and entry.plan.is_constrained:
            self.goals[plan].update(entry.plan.goals)
        if index.unfinished == 0 or index.broken or entry.cancelling:
            self.plans.add(plan)
        skill = state.skills.get(record.skill)
        frees_charger = skill is not None and skill.recharges
        if task in entry.unwanted or frees_charger:  # what is about the same may start now
            for other in state.index.active:
                self.robots.update(state.plans[other].index.ready)

    def _goals(self, state: State, goals: Iterable[str]) -> None:
        for goal in goals:
            for plan in state.index.plans_of.get(goal, ()):
                self.goals[plan].add(goal)

    def _part(self, state: State, goal: str) -> None:
        status = state.goal_states.get(goal)
        if status is not None and status.part_of is not None:
            left_behind = status.part_of not in state.goal_states
            self.held.add(goal if left_behind else status.part_of)

    def _fact(self, state: State, key: FactKey) -> None:
        index, subject = state.index, key.subject
        concerned = (subject,) if subject in state.places else carried_by(index, subject)
        for about in concerned:
            self._goals(state, index.goals_about.get(about, ()))
            if state.logic >= WATCHED_SINCE_LOGIC:
                watching = index.goals_watching.get(about, EMPTY)
                self._goals(state, watching)
                self.held.update(goal for goal in watching if state.goal_states[goal].state in HELD)
        if key.relation == CHARGE:
            self.charges.add(subject)
        if key.relation == AT:
            self.plans.update(p for p in index.active if subject in state.plans[p].plan.seeks)
