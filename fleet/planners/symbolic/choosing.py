"""Chooses one action sequence for each subgoal, as the strategy says, by the plans they lead to.

Plans are compared by what they take with a quick allocation; the few best with the best allocation
there is, if they are small. Of many goals, the work that sequences are for robots of each kind
decides first (`workloads`), and a few changes of that choice are compared as plans. In the end
carriers that go the same way are made one.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from math import prod

from fleet.core.checker.plan_checker import CheckedPlan, InvalidPlan, check_plan
from fleet.planners.base import (
    BIG_DAG,
    LEAST_WORK,
    MONOLITHIC,
    PER_GOAL,
    NoPlan,
    PlanningProblem,
)
from fleet.planners.deordering import ActionSequence, deordered
from fleet.planners.symbolic.action_sequences import Exploration
from fleet.planners.symbolic.candidates import Best, Candidate, Choice, Pace, allocated_as, by_cost
from fleet.planners.symbolic.flat_list import Team, in_one_list
from fleet.planners.symbolic.joint_trips import Pair, Trips
from fleet.planners.symbolic.roles import Roles
from fleet.planners.symbolic.workloads import Balance, Workloads, balanced, unloading_s
from fleet.scheduling.quick_allocation import quick_allocation
from keyexpr_schema.payloads.plans import Plan

MAX_COMBINATIONS = 256
"""Up to this many combinations are all compared; beyond, one sequence is changed at a time."""
MANY = 16
"""Subgoals that are many, however few sequences there are for each."""
MOST_CHANGES = 24
"""Of those changes, how many are compared as plans: those that spread the work best."""
MOST_REFINED = 12
"""Of those, how many of the most promising get a better allocation."""
MOST_JOINED = 24
"""Pairs of trips that are tried as one trip before no more are joined."""
FEW = 32
"""Beside a joint trip, up to so many combinations of what the others do are all compared."""


def choose(
    problem: PlanningProblem, options: Sequence[Choice], explored: Exploration | None
) -> CheckedPlan | NoPlan:
    """A plan of one sequence of each of the `options`, and of all that are to `explore`."""
    return _Choosing(problem, explored).made(options)


@dataclass(frozen=True)
class _Choosing:
    problem: PlanningProblem
    explored: Exploration | None

    @cached_property
    def pace(self) -> Pace:
        """Of comparing plans of many goals."""
        return Pace(self.problem.budget)

    @cached_property
    def roles(self) -> Roles:
        """Of all sequences."""
        return Roles(self.problem.world)

    @cached_property
    def workloads(self) -> Workloads:
        """Of all sequences."""
        return Workloads(self.problem.world, self.roles, self.problem.loads)

    @cached_property
    def trips(self) -> Trips:
        """Of all sequences."""
        return Trips(self.problem.world)

    def made(self, options: Sequence[Choice]) -> CheckedPlan | NoPlan:
        """The plan that the problem's strategy leads to."""
        if self.problem.strategy == MONOLITHIC:
            best = self._best([alternatives[:1] for alternatives in options])
            if isinstance(best, NoPlan) and not self.problem.budget.over:
                best = self._best(options)
        elif self.problem.strategy == PER_GOAL:
            # What is best for each goal alone may not fit together: two may want one helper.
            best = self._each_alone(options) or self._best(options)
        else:
            best = self._best(options)
        if isinstance(best, NoPlan):
            return best
        if self.problem.strategy in (BIG_DAG, LEAST_WORK):
            best = self._with_joint_trips(best, options)
        return best.allocated.checked

    def _each_alone(self, options: Sequence[Choice]) -> Candidate | None:
        """For each goal what is best as if there were no other, if that is a plan in time."""
        if _are_many(options):
            return self._each_alone_quickly(options)
        alone, choice = replace(self, explored=None), list[Choice]()
        for goal in dict.fromkeys(alternatives[0].goal for alternatives in options):
            mine = [alternatives for alternatives in options if alternatives[0].goal == goal]
            best = alone._best(mine)
            if isinstance(best, NoPlan) or self.problem.budget.over:
                return None
            choice += [(sequence,) for sequence in best.choice]
        together = self._best(choice)
        return together if isinstance(together, Candidate) else None

    def _each_alone_quickly(self, options: Sequence[Choice]) -> Candidate | None:
        """The same for many goals: each goal's sequences done by those who can be there first."""
        choice: list[ActionSequence] = []
        for goal in dict.fromkeys(alternatives[0].goal for alternatives in options):
            mine = [alternatives for alternatives in options if alternatives[0].goal == goal]
            few = prod(map(len, mine)) <= FEW
            choices: Iterator[Choice] = product(*(mine if few else (row[:1] for row in mine)))
            choice += min(choices, key=lambda row: self._alone_s(tuple(row)))
        if Balance(self.workloads, [choice], choice).estimate.crowded:
            return None
        together = self._candidate(choice)
        return together if isinstance(together, Candidate) else None

    def _alone_s(self, choice: Choice) -> float:
        """What they take the team as it stands, with the charge for what is left in baskets."""
        team = Team(self.problem.world, self.roles)
        loads = sum(len(role.leaves) for each in choice for role in self.roles.of(each))
        last_s = max(team.take(each)[1] for each in choice)
        return last_s + unloading_s(self.problem.world) * loads

    def _best(self, options: Sequence[Choice]) -> Candidate | NoPlan:
        """The cheapest candidate: of few combinations the cheapest of all; else from the cheapest
        sequence of each, one is changed at a time for as long as that helps.

        When the time is over it is the cheapest of those looked at until then, at least one.
        """
        if prod(map(len, options)) > MAX_COMBINATIONS:
            return self._one_at_a_time(options)
        best = Best()
        for found in self._ranked(product(*options), MOST_REFINED):
            if best.found is not None and self.problem.budget.over:
                break
            best.improved(found)
        return best.result

    def _one_at_a_time(self, options: Sequence[Choice]) -> Candidate | NoPlan:
        cheapest = [alternatives[0] for alternatives in options]
        balance = balanced(Balance(self.workloads, options, cheapest), options)
        best = Best()
        self._compare(best, balance.chosen)
        if best.found is None or not self.pace.over:
            self._compare(best, cheapest)
        for tried, (number, sequence) in enumerate(_changes(balance, options)):
            if self.pace.over or (best.found and tried >= MOST_CHANGES):
                break
            current = best.found.choice if best.found else balance.chosen
            self._compare(best, [*current[:number], sequence, *current[number + 1 :]])
        return best.result

    def _compare(self, best: Best, choice: Choice) -> bool:
        """Whether the plan of a choice is better."""
        self.pace.begin()
        improved = best.improved(self._candidate(choice))
        self.pace.end()
        return improved

    def _ranked(self, choices: Iterator[Choice], most_refined: int) -> list[Candidate | NoPlan]:
        """All that are valid, the cheapest first; so many of the cheapest with better allocations.
        Before them why another is not valid, if one is not.
        """
        candidates: list[Candidate] = []
        failures: list[NoPlan] = []
        for choice in choices:
            found = self._candidate(choice)
            if isinstance(found, Candidate):
                candidates.append(found)
            else:
                failures.append(found)
            if self.problem.budget.over:
                break
        candidates.sort(key=by_cost)
        for number, candidate in enumerate(candidates[:most_refined]):
            if self.problem.budget.over:
                break
            candidates[number] = candidate.refined()
        return [*failures[:1], *sorted(candidates, key=by_cost)]

    def _with_joint_trips(self, begin: Candidate, options: Sequence[Choice]) -> Candidate:
        """Sequences for two goals joined into one with one carrier, for as long as that helps."""
        best, ways = begin, [list(alternatives) for alternatives in options]
        if _are_many(options):
            return self._many_joined(best, ways)
        while (joint := self._joint_trip(best, ways)) is not None:
            (one, other, made), best = joint
            ways[one] = [made.sequence]
            del ways[other]
        return best

    def _many_joined(self, begin: Candidate, options: Sequence[Choice]) -> Candidate:
        """Of many goals, all pairs of trips at once that are less work as one; where that is no
        better a plan, the half of them that save most, and so on."""
        best, ways = Best(begin), list(options)
        while best.found is not None and not self.pace.over:
            before = best.found
            balance, pairs = self._joined(before, self.trips.pairs(ways))
            while pairs and not self.pace.over:
                if self._compare(best, balance.chosen):
                    break
                balance, pairs = self._joined(before, pairs[: len(pairs) // 2])
            if best.found is before:
                break
            ways = [[sequence] for sequence in best.found.choice]
        return best.found or begin

    def _joined(self, begin: Candidate, pairs: Sequence[Pair]) -> tuple[Balance, list[Pair]]:
        """The choice with those pairs joined, each on its own, that are less work; and which."""
        joint = [(pair.made.sequence,) for pair in pairs]
        single = [(sequence,) for sequence in begin.choice]
        balance = Balance(self.workloads, [*single, *joint], begin.choice)
        taken: list[Pair] = []
        free = set(range(len(begin.choice)))
        for pair in pairs:
            if not {pair.one, pair.other} <= free:
                continue
            before = balance.estimate, balance.choice[pair.one], balance.choice[pair.other]
            balance.put(pair.one, pair.made.sequence)
            balance.put(pair.other, None)
            if balance.estimate < before[0]:
                taken.append(pair)
                free -= {pair.one, pair.other}
            else:
                balance.put(pair.one, before[1])
                balance.put(pair.other, before[2])
        return balance, taken

    def _joint_trip(
        self, begin: Candidate, ways: Sequence[Choice]
    ) -> tuple[Pair, Candidate] | None:
        """The pair of trips that makes the cheapest plan as one, and that plan, if it is cheaper.

        Of many goals it is the first pair that helps, and the others stay as they are.
        """
        best, chosen = Best(begin), None
        for pair in self.trips.pairs(ways)[:MOST_JOINED]:
            if self.problem.budget.over:
                break
            one, other, made = pair
            few = prod(len(row) for k, row in enumerate(ways) if k not in (one, other)) <= FEW
            rest = list(ways) if few else [(each,) for each in begin.choice]
            rest[one] = (made.sequence,)
            del rest[other]
            for found in self._ranked(product(*rest), MOST_REFINED):
                if best.improved(found):
                    chosen = pair
            if chosen is not None and not few:
                break
        return None if chosen is None or best.found is None else (chosen, best.found)

    def _candidate(self, choice: Choice) -> Candidate | NoPlan:
        plan = self._plan(choice)
        checked = check_plan(plan, self.problem.world)
        if isinstance(checked, InvalidPlan):
            return NoPlan(checked.violations[0].sentence, checked.violations)
        made = allocated_as(choice, checked, quick_allocation(checked))
        if made is None:
            return NoPlan("there are fewer robots than the plan needs at the same time")
        if not self.problem.loads:
            return made
        return replace(made, crowded=Balance(self.workloads, [choice], choice).estimate.crowded)

    def _plan(self, choice: Choice) -> Plan:
        """The plan of these sequences; it promises the conditions of goals that have one."""
        problem, explored = self.problem, self.explored
        sequences = [*choice, *(explored.sequences if explored else ())]
        if problem.strategy == MONOLITHIC:
            things = {s for goal in problem.goals for c in goal.conditions for s in c.subjects}
            constrained = bool(problem.always or problem.never or problem.sometime_before)
            sequences = in_one_list(sequences, problem.world, self.roles, things, constrained)
        tasks, pins = deordered(
            sequences,
            problem.first_task,
            one_actor_each=problem.strategy == MONOLITHIC,
            world=problem.world,
            in_order=problem.sometime_before,
        )
        seeks = frozenset(explored.seeks if explored else ())
        served = frozenset[str]().union(*(sequence.goals for sequence in choice))
        conditions = tuple(
            condition
            for goal in problem.goals
            for condition in goal.conditions
            if seeks.isdisjoint(condition.subjects)
            and (goal.goal in served or problem.world.holds(condition))
        )
        return Plan(
            plan=problem.plan,
            revision=problem.revision,
            goals=tuple(goal.goal for goal in problem.goals),
            conditions=(*conditions, *(explored.conditions if explored else ())),
            tasks=tasks,
            pins=pins,
            strategy=problem.strategy,
            made_by="symbolic",
            allocator=problem.allocator,
            seeks=tuple(explored.seeks) if explored else (),
            always=problem.always,
            never=problem.never,
            sometime_before=problem.sometime_before,
            by=problem.by,
        )


def _are_many(options: Sequence[Choice]) -> bool:
    """Whether too many to look at each pair, or at each alone, as a plan."""
    return len(options) > MANY or prod(map(len, options)) > MAX_COMBINATIONS


def _changes(balance: Balance, options: Sequence[Choice]) -> Iterator[tuple[int, ActionSequence]]:
    """Other sequences for single goals, those first that spread the work best."""
    rows = [
        (balance.estimate_with(number, sequence), number, place)
        for number, alternatives in enumerate(options)
        for place, sequence in enumerate(alternatives)
        if sequence is not balance.choice[number]
    ]
    for _, number, place in sorted(rows):
        yield number, options[number][place]
