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

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import cycle, product
from math import inf, prod

from fleet.core.actors import carried_at_end, least_loaded
from fleet.core.checker.plan_checker import CheckedPlan, InvalidPlan, check_plan
from fleet.core.model.world import WorldModel
from fleet.planners.base import BIG_DAG, MONOLITHIC, PER_GOAL, NoPlan, Planner, PlanningProblem
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
        sequences, self.facts = found
        self.options.append(sequences)
        if self.problem.strategy == MONOLITHIC:
            for action in sequences[0].actions:
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
    """A valid plan for a choice of sequences, each actor with the able robot that has least to do.

    Until it is verified, `cost` is that of the shortest schedule, which need not pass the checker.
    """

    choice: Choice
    allocated: AllocatedPlan
    cost: Cost

    def verified(self) -> _Candidate | NoPlan:
        """With the cost of the shortest schedule that passes the checker."""
        found = self.allocated.valid_schedule()
        if isinstance(found, tuple):
            return NoPlan(found[0].sentence, found)
        return replace(self, cost=_cost(found, self.allocated.checked))


def _cost(schedule: PlanSchedule, checked: CheckedPlan) -> Cost:
    unloading_s = UNLOADING_S * len(carried_at_end(checked))
    return round(schedule.makespan_s + unloading_s, 3), sum(schedule.durations_s.values())


def _choose(
    problem: PlanningProblem, options: Sequence[Choice], explored: Exploration | None
) -> CheckedPlan | NoPlan:
    best: _Candidate | NoPlan | None = None
    if problem.strategy == MONOLITHIC:
        best = _best(problem, [alternatives[:1] for alternatives in options], explored)
    elif problem.strategy == PER_GOAL:
        choice: list[Choice] = []
        for goal in dict.fromkeys(alternatives[0].goal for alternatives in options):
            mine = [alternatives for alternatives in options if alternatives[0].goal == goal]
            alone = _best(problem, mine, None)
            if isinstance(alone, NoPlan):
                break
            choice += [(sequence,) for sequence in alone.choice]
        else:
            best = _best(problem, choice, explored)
        # What is best for each goal alone may not fit together, as where two want one helper.
        best = best if isinstance(best, _Candidate) else None
    best = best or _best(problem, options, explored)
    return best if isinstance(best, NoPlan) else best.allocated.checked


def _best(
    problem: PlanningProblem, options: Sequence[Choice], explored: Exploration | None
) -> _Candidate | NoPlan:
    """The cheapest candidate: of few combinations the cheapest of all; else from the cheapest
    sequence of each, one is changed at a time for as long as that helps.
    """
    best: _Candidate | None = None
    failure: NoPlan | None = None

    def better(found: _Candidate | NoPlan) -> bool:
        nonlocal best, failure
        # Verifying does not make a plan cheaper: only what looks cheaper is verified.
        if isinstance(found, _Candidate) and (best is None or found.cost < best.cost):
            found = found.verified()
            if isinstance(found, _Candidate) and (best is None or found.cost < best.cost):
                best = found
                return True
        failure = found if failure is None and isinstance(found, NoPlan) else failure
        return False

    def candidate(choice: Choice) -> _Candidate | NoPlan:
        return _candidate(problem, choice, explored)

    if prod(map(len, options)) <= MAX_COMBINATIONS:
        for found in sorted(map(candidate, product(*options)), key=_promise):
            better(found)
    else:
        current = [alternatives[0] for alternatives in options]
        better(candidate(current))
        unchanged = 0
        for number, alternatives in cycle(enumerate(options)):
            if unchanged == len(options):
                break
            unchanged += 1
            for sequence in alternatives:
                changed = [*current[:number], sequence, *current[number + 1 :]]
                if changed != current and better(candidate(changed)):
                    current, unchanged = changed, 1
    return best or failure or NoPlan("no combination of action sequences passes the checker")


def _promise(found: _Candidate | NoPlan) -> Cost:
    return (-inf, -inf) if isinstance(found, NoPlan) else found.cost


def _candidate(
    problem: PlanningProblem, choice: Choice, explored: Exploration | None
) -> _Candidate | NoPlan:
    checked = check_plan(_plan(problem, choice, explored), problem.world)
    if isinstance(checked, InvalidPlan):
        return NoPlan(checked.violations[0].sentence, checked.violations)
    allocation = least_loaded(checked)
    if allocation is None:
        return NoPlan("there are fewer robots than the plan needs at the same time")
    allocated = AllocatedPlan(checked, allocation)
    schedule = next(allocated.schedules(), None)
    cost = (inf, inf) if schedule is None else _cost(schedule, checked)
    return _Candidate(choice, allocated, cost)


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
