"""The planner interface: goals and a world in, a checked plan out."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import inf

import msgspec

from fleet.core.checker.plan_checker import CheckedPlan, check_plan
from fleet.core.model.world import WorldModel
from fleet.jobshop.time_budget import TimeBudget
from fleet.planners.room_wanted import cannot_both_hold, lacks_room
from keyexpr_schema.payloads.goals import Condition, Goal, Precedence
from keyexpr_schema.payloads.plans import Plan, Violation

BIG_DAG, PER_GOAL, MONOLITHIC = "big-dag", "per-goal", "monolithic"
LEAST_WORK = "least-work"
"""How tasks for several goals come together; a planner has some of these strategies, or others."""


@dataclass(frozen=True)
class PlanningProblem:
    """Goals with their conditions, and the world to reach them in.

    `first_task` is the number of the first new task, so that task names stay unique over
    revisions of a plan. A planner whose `budget` is over gives what it has found until then. Where
    the plan will stand beside the rest of another one, `loads` are by actor of that the robots that
    can be it, for each that has a load in the end: one of them takes no further load.
    """

    plan: str
    goals: tuple[Goal, ...]
    world: WorldModel
    revision: int = 1
    strategy: str = BIG_DAG
    allocator: str = "makespan"
    first_task: int = 1
    searched: frozenset[str] = frozenset()
    """Places in which this plan has looked around already."""
    loads: tuple[frozenset[str], ...] = ()
    budget: TimeBudget = field(default_factory=lambda: TimeBudget(inf))
    keepers: Mapping[str, str] = field(default_factory=dict)
    """Goals that stand for what always or never holds, by that as it is written."""

    def whose(self, kept: Condition) -> str:
        """Which goal wants that something always or never holds, as the end of a sentence; nothing
        where there is no other."""
        keeper = self.keepers.get(str(kept))
        if keeper is None and len(self.goals) > 1:
            wanting = (g.goal for g in self.goals if kept in (*g.always, *g.never))
            keeper = next(wanting, None)
        return f", as goal {keeper} wants" if keeper else ""

    @property
    def always(self) -> tuple[Condition, ...]:
        """What must hold all the time."""
        return tuple(dict.fromkeys(row for goal in self.goals for row in goal.always))

    @property
    def never(self) -> tuple[Condition, ...]:
        """What must not hold at any time."""
        return tuple(dict.fromkeys(row for goal in self.goals for row in goal.never))

    @property
    def sometime_before(self) -> tuple[Precedence, ...]:
        """What must hold before something else may."""
        return tuple(dict.fromkeys(row for goal in self.goals for row in goal.sometime_before))

    @property
    def by(self) -> dict[str, tuple[str, ...]]:
        """By goal, the robots that alone shall do it, where it says so."""
        return {goal.goal: goal.by for goal in self.goals if goal.by}

    def world_of(self, goal: str) -> WorldModel:
        """The world with those robots only that shall see to a goal."""
        if (by := self.by.get(goal)) is None:
            return self.world
        return replace(self.world, available=frozenset(by) & frozenset(self.world.team))

    @property
    def not_in_time(self) -> str:
        """What is said of goals for which the `budget` did not suffice."""
        return f"not planned within {self.budget.seconds:g} s"


@dataclass(frozen=True)
class NoPlan:
    """Why there is no plan: a sentence, and violations where a plan was found wanting.

    `postponed`: there may be one, and only the time did not suffice to find it. `goal_reasons` are
    those of goals that have one of their own.
    """

    reason: str
    violations: tuple[Violation, ...] = field(default=())
    postponed: bool = False
    goal_reasons: Mapping[str, str] = field(default_factory=dict)


class Planner(ABC):
    """Makes plans. Subclasses solve; this class sees to it that every plan is checked."""

    name: str
    strategies: tuple[str, ...]
    waiting_s: float = 0.0
    """How long it may wait for others, such as a language model, beside the limit for planning."""

    def plan(self, problem: PlanningProblem) -> CheckedPlan | NoPlan:
        """A valid plan, or why there is none.

        Goals for which the time did not suffice are not among those of the plan.
        """
        if problem.strategy not in self.strategies:
            return NoPlan(
                f"planner {self.name} has no strategy {problem.strategy}: "
                f"choose one of {', '.join(self.strategies)}"
            )
        if not problem.world.team:
            return NoPlan("no robot is connected")
        for goal in problem.goals:
            if (clash := cannot_both_hold(goal.conditions, problem.world)) is not None:
                one, other = clash
                return NoPlan(f"goal {goal.goal} wants {one} and {other}, which cannot both hold")
        wanted = (condition for goal in problem.goals for condition in goal.conditions)
        if (why := lacks_room(wanted, problem.world)) is not None:
            return NoPlan(why)
        solved = self._solve(problem)
        if isinstance(solved, NoPlan):
            return solved
        if isinstance(solved, CheckedPlan):
            if solved.world is problem.world and solved.plan.by == problem.by:
                return solved
            solved = solved.plan
        plan = msgspec.structs.replace(solved, by=problem.by)
        checked = check_plan(plan, problem.world)
        if isinstance(checked, CheckedPlan):
            return checked
        return NoPlan(checked.violations[0].sentence, checked.violations)

    @abstractmethod
    def _solve(self, problem: PlanningProblem) -> Plan | CheckedPlan | NoPlan:
        """A plan for the problem; the caller checks it, unless its check comes along."""
