"""The symbolic planner: finds plans by search over skill models, with no network.

Every condition of every goal is a subgoal. For each, several different action sequences that reach
it are sought (for instance one with a helper that carries), and one is chosen as the strategy says:

* `big-dag` chooses for all goals together, by the makespan that they lead to;
* `per-goal` chooses for each goal alone, as if there were no other, and merges the results;
* `monolithic` makes one flat list, each goal going on from where the one before left every robot.

Where it is not known where a needed object is, the plan looks for it: a search of every place, by
all robots that can, in parallel. What is found leads to the next revision.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from heapq import heapify, heappop, heappush
from itertools import product
from math import inf, prod

from fleet.core.checker.checked_plan import CheckedPlan, InvalidPlan, check_plan
from fleet.core.model.world import WorldModel
from fleet.core.schedule.actor_constraints import least_loaded
from fleet.core.schedule.actor_order import carried_at_end
from fleet.planners.base import NoPlan, Planner, PlanningProblem
from fleet.planners.deordering import ActionSequence, deordered
from fleet.planners.symbolic.action_sequences import (
    UNLOADING_S,
    Exploration,
    Subgoal,
    alternatives_for,
    exploration_for,
    subgoals_in_order,
)
from fleet.planners.symbolic.search import Facts
from fleet.scheduling.plan_schedule import AllocatedPlan, PlanSchedule
from keyexpr_schema.facts import AT, FactKey
from keyexpr_schema.payloads.plans import Plan

BIG_DAG, PER_GOAL, MONOLITHIC = "big-dag", "per-goal", "monolithic"
MAX_COMBINATIONS = 64
"""Up to this many combinations are all compared; beyond, one sequence is changed at a time."""
MAX_RESTORATIONS = 2
"""How often what the sequences for later subgoals undid is reached again, where no plan does."""

Choice = Sequence[ActionSequence]
Cost = tuple[float, float]
"""The makespan [s], with a charge for what is left in baskets, and the work of all robots [s]."""


class SymbolicPlanner(Planner):
    """Search over skill models."""

    name = "symbolic"
    strategies = (BIG_DAG, PER_GOAL, MONOLITHIC)

    def _solve(self, problem: PlanningProblem) -> CheckedPlan | NoPlan:
        world = problem.world
        reached = _Reached(problem, dict(world.facts))
        unlocated: list[Subgoal] = []
        for subgoal in subgoals_in_order(problem, world.facts):
            if reached.add(subgoal):
                continue
            if not _needs_locating(subgoal, reached.facts, world):
                return NoPlan(_no_way(subgoal, world))
            unlocated.append(subgoal)
        explored = exploration_for(unlocated, problem) if unlocated else None
        if unlocated and explored is None:
            return NoPlan(_not_found(unlocated[0], problem))
        made = _choose(problem, reached.options, explored)
        for _ in range(MAX_RESTORATIONS):
            undone = [s for s in subgoals_in_order(problem, reached.facts) if s not in unlocated]
            if isinstance(made, CheckedPlan) or not (undone and all(map(reached.add, undone))):
                break
            restored = _choose(problem, reached.options, explored)
            made = restored if isinstance(restored, CheckedPlan) else made
        return made


@dataclass
class _Reached:
    """Action sequences for one subgoal after the other, and the facts after the cheapest of each.

    Robots of a flat list are `settled`: they start from where the sequence before left them.
    """

    problem: PlanningProblem
    facts: Facts
    options: list[Choice] = field(default_factory=list)
    settled: set[str] = field(default_factory=set)

    def add(self, subgoal: Subgoal) -> bool:
        """Find sequences that reach one more subgoal; whether there are any."""
        settled = frozenset(self.settled)
        found = alternatives_for(subgoal, self.facts, self.problem.world, settled)
        if found is None:
            return False
        self.options.append(found.sequences)
        self.facts = found.facts
        if self.problem.strategy == MONOLITHIC:
            for action in found.sequences[0].actions:
                self.settled.update(action.participants)
        return True


def _needs_locating(subgoal: Subgoal, facts: Facts, world: WorldModel) -> bool:
    return any(
        subject in world.objects and facts.get(FactKey(AT, subject)) is None
        for subject in subgoal.condition.subjects
    )


def _no_way(subgoal: Subgoal, world: WorldModel) -> str:
    return (
        f"no sequence of skills of the connected robots ({', '.join(world.team)}) "
        f"leads to {subgoal.condition}"
    )


def _not_found(subgoal: Subgoal, problem: PlanningProblem) -> str:
    things = " or ".join(subgoal.condition.subjects)
    if problem.searched:
        places = ", ".join(sorted(problem.searched))
        return f"nobody knows where {things} is; looked for in {places}, and not found"
    return (
        f"nobody knows where {things} is, and no connected robot "
        f"({', '.join(problem.world.team)}) can look for it"
    )


@dataclass(frozen=True)
class _Candidate:
    """A valid plan for a choice of sequences, and what it costs.

    `allocation` gives each actor the able robot with the least to do. Until `verified`, the cost is
    that of the shortest schedule, which may not pass the checker with robots for actors.
    """

    choice: Choice
    checked: CheckedPlan
    allocation: Mapping[str, str]
    cost: Cost
    verified: bool = False

    def verify(self) -> _Candidate | NoPlan:
        """The candidate with the cost of its shortest schedule that passes the checker."""
        found = AllocatedPlan(self.checked, self.allocation).valid_schedule()
        if isinstance(found, tuple):
            return NoPlan(found[0].sentence, found)
        return replace(self, cost=_cost(found, self.checked), verified=True)


def _cost(schedule: PlanSchedule, checked: CheckedPlan) -> Cost:
    unloading_s = UNLOADING_S * len(carried_at_end(checked))
    return round(schedule.makespan_s + unloading_s, 3), schedule.work_s


def _choose(
    problem: PlanningProblem, options: Sequence[Choice], explored: Exploration | None
) -> CheckedPlan | NoPlan:
    if problem.strategy == MONOLITHIC:
        return _plan_of(problem, [alternatives[0] for alternatives in options], explored)
    if problem.strategy == PER_GOAL:
        choice: list[ActionSequence] = []
        for goal in dict.fromkeys(alternatives[0].goal for alternatives in options):
            mine = [alternatives for alternatives in options if alternatives[0].goal == goal]
            alone = _best(problem, mine, None)
            if isinstance(alone, NoPlan):
                break
            choice.extend(alone.choice)
        else:
            merged = _plan_of(problem, choice, explored)
            if isinstance(merged, CheckedPlan):
                return merged
        # What is best for each goal alone does not fit together, as where two want one helper.
    best = _best(problem, options, explored)
    return best if isinstance(best, NoPlan) else best.checked


def _plan_of(
    problem: PlanningProblem, choice: Choice, explored: Exploration | None
) -> CheckedPlan | NoPlan:
    """The plan of one choice, if it can be allocated."""
    candidate = _candidate(problem, choice, explored)
    verified = candidate if isinstance(candidate, NoPlan) else candidate.verify()
    return verified if isinstance(verified, NoPlan) else verified.checked


def _best(
    problem: PlanningProblem, options: Sequence[Choice], explored: Exploration | None
) -> _Candidate | NoPlan:
    """The cheapest candidate; of few combinations the cheapest of all."""

    def candidate(choice: Choice) -> _Candidate | NoPlan:
        return _candidate(problem, choice, explored)

    if prod(map(len, options)) <= MAX_COMBINATIONS:
        return _cheapest([candidate(choice) for choice in product(*options)])
    return _hill_climbed(options, candidate)


def _cheapest(candidates: Sequence[_Candidate | NoPlan]) -> _Candidate | NoPlan:
    """The cheapest that can be verified, the first of equals; or why the first one cannot be.

    Verifying does not make a plan cheaper, so only those that look cheapest are verified.
    """
    open_: dict[int, _Candidate] = {}
    failed: dict[int, NoPlan] = {}
    for number, candidate in enumerate(candidates):
        if isinstance(candidate, NoPlan):
            failed[number] = candidate
        else:
            open_[number] = candidate
    queue = [(candidate.cost, number) for number, candidate in open_.items()]
    heapify(queue)
    while queue:
        _, number = heappop(queue)
        if open_[number].verified:
            return open_[number]
        verified = open_[number].verify()
        if isinstance(verified, NoPlan):
            failed[number] = verified
        else:
            open_[number] = verified
            heappush(queue, (verified.cost, number))
    return failed[min(failed)]


def _hill_climbed(
    options: Sequence[Choice], candidate: Callable[[Choice], _Candidate | NoPlan]
) -> _Candidate | NoPlan:
    """From the cheapest sequence of each, one is changed at a time for as long as that helps."""
    best: _Candidate | None = None
    failure: NoPlan | None = None

    def better(choice: Choice) -> bool:
        nonlocal best, failure
        found = candidate(choice)
        if isinstance(found, _Candidate):
            if best is not None and found.cost >= best.cost:
                return False
            found = found.verify()
        if isinstance(found, NoPlan):
            failure = failure or found
        elif best is None or found.cost < best.cost:
            best = found
            return True
        return False

    current = [alternatives[0] for alternatives in options]
    better(current)
    improved = True
    while improved:
        improved = False
        for number, alternatives in enumerate(options):
            for sequence in alternatives:
                changed = [*current[:number], sequence, *current[number + 1 :]]
                if changed != current and better(changed):
                    current, improved = changed, True
    return best or failure or NoPlan("no combination of action sequences passes the checker")


def _candidate(
    problem: PlanningProblem, choice: Choice, explored: Exploration | None
) -> _Candidate | NoPlan:
    checked = check_plan(_plan(problem, choice, explored), problem.world)
    if isinstance(checked, InvalidPlan):
        return NoPlan(checked.violations[0].sentence, checked.violations)
    allocation = least_loaded(checked)
    if allocation is None:
        return NoPlan("there are fewer robots than the plan needs at the same time")
    schedule = next(AllocatedPlan(checked, allocation).schedules(), None)
    cost = (inf, inf) if schedule is None else _cost(schedule, checked)
    return _Candidate(choice, checked, allocation, cost)


def _plan(problem: PlanningProblem, choice: Choice, explored: Exploration | None) -> Plan:
    """The plan of these sequences; it promises the conditions of goals that have one."""
    sequences = [*choice, *(explored.sequences if explored else ())]
    tasks, pins = deordered(
        sequences, problem.first_task, one_actor_each=problem.strategy == MONOLITHIC
    )
    seeks = frozenset(explored.seeks if explored else ())
    served = {sequence.goal for sequence in choice}
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
    )
