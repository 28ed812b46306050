"""Subgoals reached one after the other, each from where the one before left the world."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import inf

from msgspec import structs

from fleet.core.model.world import condition_holds
from fleet.jobshop.time_budget import TimeBudget
from fleet.planners.base import LEAST_WORK, MONOLITHIC, NoPlan, PlanningProblem
from fleet.planners.symbolic.action_sequences import (
    GaveUp,
    Impossible,
    Subgoal,
    alternatives_for,
)
from fleet.planners.symbolic.candidates import Choice
from fleet.planners.symbolic.engine.constraints import Trajectory
from fleet.planners.symbolic.engine.instantiation import Facts
from keyexpr_schema.facts import AT, HOLDING, FactKey
from keyexpr_schema.payloads.goals import Condition, Precedence


@dataclass(frozen=True)
class Manner:
    """What has to hold first is made so `in_order`, before anything else; what may then hold is
    avoided where it is not one of those. Robots are `bound` to what they were found to do.
    """

    in_order: tuple[Precedence, ...] = ()
    bound: bool = False


CHOOSING = 1.0
"""Making one plan takes, for each of its subgoals, as long as so many of the quickest searches."""


@dataclass
class Reached:
    """Action sequences for one subgoal after the other, and the facts after the cheapest of each.

    What was delivered in a robot's basket is taken to be `set_down` there, so that the ways for
    later subgoals do not depend on how it was delivered: another robot may have done it. If
    `patient`, more time is spent on finding the cheapest.
    """

    problem: PlanningProblem
    manner: Manner
    facts: Facts
    budget: TimeBudget
    set_down: bool = True
    patient: bool = False
    options: list[Choice] = field(default_factory=list)
    any_set_down: bool = False
    failure: Impossible | GaveUp = field(default_factory=lambda: Impossible("nothing was sought"))
    passed: set[Precedence] = field(default_factory=set)
    quickest_s: float = inf

    @property
    def time_is_up(self) -> bool:
        """Whether the time for searching is over, or what is left is needed to choose."""
        choosing_s = CHOOSING * self.quickest_s * len(self.options) if self.options else 0.0
        return self.budget.over or self.problem.budget.left_s < choosing_s

    def pass_first(self) -> NoPlan | None:
        """Reach what has to hold before something else may; why that cannot be done, if it cannot.

        One may have to come before the other: each is sought while of none that is left the second
        may hold.
        """
        problem, left = self.problem, list(self.manner.in_order)
        while left:
            for row in left:
                goal = next(g.goal for g in problem.goals if row in g.sometime_before)
                holds = condition_holds(self.facts, row.first, problem.world)
                if holds or self.add(Subgoal(goal, row.first), 0.5):
                    self.passed.add(row)
                    left.remove(row)
                    break
            else:
                reason = no_way(Subgoal(goal, row.first), self.failure, problem)
                return NoPlan(reason, postponed=isinstance(self.failure, GaveUp))
        return None

    def restore(self, subgoals: Sequence[Subgoal]) -> bool:
        """Find sequences that reach again what others undid, without undoing those in turn: what
        is in a robot's basket is taken out where that robot has to be elsewhere."""
        return all(self.add(subgoal, keeps=True) for subgoal in subgoals)

    def add(self, subgoal: Subgoal, share: float = 1.0, keeps: bool = False) -> bool:
        """Find sequences that reach one more subgoal, in a share of what is left of the time;
        whether there are any. If it `keeps`, they undo no condition if they can.
        """
        budget = self.budget if share == 1.0 else self.budget.part(share)
        problem = self.problem
        too_early = (row.then for row in problem.sometime_before if row not in self.passed)
        way = Trajectory(problem.always, problem.never, tuple(too_early))
        if problem.strategy == MONOLITHIC:
            kept = tuple(c for c in self._in_baskets() if c != subgoal.condition)
            subgoal = replace(subgoal, others=(*subgoal.others, *kept))
        left_s = problem.budget.left_s
        patient = self.patient or problem.strategy == LEAST_WORK
        world = problem.world_of(subgoal.goal)
        found = alternatives_for(
            subgoal, self.facts, world, budget, on_the_way=way, patient=patient
        )
        if not isinstance(found, tuple):
            self.failure = found
            return False
        if rather := self._rather_kept(subgoal, found[1], keeps):
            both = replace(subgoal, others=(*subgoal.others, *rather))
            again = alternatives_for(
                both, self.facts, world, budget, on_the_way=way, patient=patient
            )
            found = again if isinstance(again, tuple) else found
        self.quickest_s = min(self.quickest_s, left_s - problem.budget.left_s)
        sequences, self.facts = found
        if self.manner.bound or world is not problem.world:
            robots = frozenset(world.team)
            sequences = tuple(replace(sequence, named=robots) for sequence in sequences)
        self.options.append(sequences)
        if self.set_down:
            self._set_down(subgoal)
        return True

    def _rather_kept(self, subgoal: Subgoal, after: Facts, keeps: bool) -> tuple[Condition, ...]:
        """Conditions that do not hold any more `after` a subgoal is reached, for those for whom
        they hold now, where another would do: a cup for the one and a cup for the other. If it
        `keeps` any, also where none would."""
        world, found = self.problem.world, list[Condition]()
        mine = (subgoal.condition, *subgoal.others)
        for condition in (c for goal in self.problem.goals for c in goal.conditions):
            kept = keeps or condition.any_of or subgoal.condition.any_of
            if kept and condition not in mine and not condition_holds(after, condition, world):
                each = (
                    structs.replace(condition, subject=s, any_of=()) for s in condition.subjects
                )
                found += [c for c in each if condition_holds(self.facts, c, world)][:1]
        return tuple(found)

    def _set_down(self, subgoal: Subgoal) -> None:
        """Take what it is about to be where the robot is that has it in its basket, if no other
        condition speaks of it."""
        for thing in subgoal.condition.subjects:
            robot = str(self.facts.get(FactKey(AT, thing)))
            place = self.facts.get(FactKey(AT, robot))
            if (
                robot in self.problem.world.robots
                and place in self.problem.world.places
                and self.facts.get(FactKey(HOLDING, robot)) != thing
                and self._spoken_of[thing] == 1
            ):
                self.facts = {**self.facts, FactKey(AT, thing): place}
                self.any_set_down = True

    @cached_property
    def _spoken_of(self) -> Counter[object]:
        """In how many conditions things occur."""
        problem = self.problem
        rows = [c for goal in problem.goals for c in (*goal.conditions, *goal.constraints)]
        return Counter(name for c in rows for name in (*c.subjects, c.value))

    def _in_baskets(self) -> Iterator[Condition]:
        """What is reached by something that is in a basket, and undone if its robot drives off."""
        problem = self.problem
        for goal in problem.goals:
            for condition in goal.conditions:
                carriers = [self.facts.get(FactKey(AT, s)) for s in condition.subjects]
                if any(robot in problem.world.robots for robot in carriers) and condition_holds(
                    self.facts, condition, problem.world
                ):
                    yield condition


def no_way(subgoal: Subgoal, why: Impossible | GaveUp, problem: PlanningProblem) -> str:
    """Why a subgoal is out of reach, as a sentence with what has to hold on the way."""
    world = problem.world_of(subgoal.goal)
    whom = f"the connected robots ({', '.join(world.team)})"
    if (by := problem.by.get(subgoal.goal)) is not None:
        whom = f"{' and '.join(by)}, who shall do it,"
        if missing := [robot for robot in by if robot not in world.team]:
            whom = f"{whom} (not connected: {', '.join(missing)})"
    helped = "; who else may help must be named with them" if by is not None else ""
    kept = [
        f"{condition} must always hold{problem.whose(condition)}" for condition in problem.always
    ]
    kept += [
        f"{condition} must never hold{problem.whose(condition)}" for condition in problem.never
    ]
    kept += [f"{row.first} must hold before {row.then} does" for row in problem.sometime_before]
    on_the_way = f"; on the way {' and '.join(kept)}" if kept else ""
    failed = (f"; {known.robot} cannot {known.skill}: {known.reason}" for known in world.hopeless)
    return (
        f"no sequence of skills of {whom} "
        f"leads to {subgoal}: {why.reason}{on_the_way}{''.join(failed)}{helped}"
    )
