"""The symbolic planner: finds plans by search over skill models, with no network.

Every condition of every goal becomes a strand: a sequence of actions that makes it true. Several
different ones are sought (for instance one with a helper that carries), and chosen as the strategy
says:

* `big-dag` chooses for all goals together, by the makespan that they lead to;
* `per-goal` chooses for each goal alone, as if there were no other, and merges the results;
* `monolithic` makes one flat list, each goal going on from where the one before left every robot.

Where it is not known where a needed object is, the plan looks for it: a search of every place, by
all robots that can, in parallel. What is found leads to the next revision.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product

from fleet.core.checker.plan_checker import check_plan
from fleet.core.model.world import WorldModel
from fleet.core.schedule.actor_constraints import least_loaded
from fleet.core.schedule.actor_order import carried_at_end
from fleet.planners.base import NoPlan, Planner, PlanningProblem
from fleet.planners.deordering import Strand, tasks_from
from fleet.planners.symbolic.action_sequences import (
    UNLOADING_S,
    Aim,
    Exploration,
    aims_in_order,
    exploration_for,
    options_for,
)
from fleet.planners.symbolic.search import Facts
from fleet.scheduling.plan_schedule import AllocatedPlan
from keyexpr_schema.facts import AT, FactKey
from keyexpr_schema.payloads.plans import Plan

BIG_DAG, PER_GOAL, MONOLITHIC = "big-dag", "per-goal", "monolithic"
MAX_COMBINATIONS = 64
"""Up to this many combinations are all tried; beyond, one strand is changed at a time."""


class SymbolicPlanner(Planner):
    """Search over skill models."""

    name = "symbolic"
    strategies = (BIG_DAG, PER_GOAL, MONOLITHIC)

    def _solve(self, problem: PlanningProblem) -> Plan | NoPlan:
        world = problem.world
        facts: Facts = dict(world.facts)
        options: list[tuple[Strand, ...]] = []
        unknown: list[Aim] = []
        settled: set[str] = set()
        for aim in aims_in_order(problem):
            found = options_for(aim, facts, world, frozenset(settled))
            if found is not None:
                options.append(found.strands)
                facts = found.facts
                if problem.strategy == MONOLITHIC:
                    for action in found.strands[0].actions:
                        settled.update(action.participants)
            elif _where_is_unknown(aim, facts, world):
                unknown.append(aim)
            else:
                return NoPlan(_no_way(aim, world))
        explored = exploration_for(unknown, problem) if unknown else None
        if unknown and explored is None:
            return NoPlan(_not_found(unknown[0], problem))
        return _choose(problem, options, explored)


def _where_is_unknown(aim: Aim, facts: Facts, world: WorldModel) -> bool:
    return any(
        subject in world.objects and facts.get(FactKey(AT, subject)) is None
        for subject in aim.condition.subjects
    )


def _no_way(aim: Aim, world: WorldModel) -> str:
    return (
        f"no sequence of skills of the connected robots ({', '.join(world.team)}) "
        f"leads to {aim.condition}"
    )


def _not_found(aim: Aim, problem: PlanningProblem) -> str:
    things = " or ".join(aim.condition.subjects)
    if problem.searched:
        places = ", ".join(sorted(problem.searched))
        return f"nobody knows where {things} is; looked for in {places}, and not found"
    return (
        f"nobody knows where {things} is, and no connected robot "
        f"({', '.join(problem.world.team)}) can look for it"
    )


def _choose(
    problem: PlanningProblem, options: Sequence[Sequence[Strand]], explored: Exploration | None
) -> Plan | NoPlan:
    if problem.strategy == MONOLITHIC:
        return _checked(problem, [strands[0] for strands in options], explored)
    if problem.strategy == PER_GOAL:
        choice: list[Strand] = []
        for goal in dict.fromkeys(strands[0].goal for strands in options):
            mine = [strands for strands in options if strands[0].goal == goal]
            alone = _best(problem, mine, None)
            if isinstance(alone, NoPlan):
                break
            choice.extend(alone)
        else:
            merged = _checked(problem, choice, explored)
            if isinstance(merged, Plan):
                return merged
        # What is best for each goal alone does not fit together, as where two want one helper.
    best = _best(problem, options, explored)
    return best if isinstance(best, NoPlan) else _plan(problem, best, explored)


def _checked(
    problem: PlanningProblem, choice: Sequence[Strand], explored: Exploration | None
) -> Plan | NoPlan:
    plan = _plan(problem, choice, explored)
    value = _evaluate(plan, problem.world)
    return value if isinstance(value, NoPlan) else plan


def _best(
    problem: PlanningProblem,
    options: Sequence[Sequence[Strand]],
    explored: Exploration | None,
) -> list[Strand] | NoPlan:
    """One strand of each, so that the makespan is small."""
    best: tuple[tuple[float, float], list[Strand]] | None = None
    failure: NoPlan | None = None

    def consider(choice: Sequence[Strand]) -> bool:
        nonlocal best, failure
        value = _evaluate(_plan(problem, choice, explored), problem.world)
        if isinstance(value, NoPlan):
            failure = failure or value
            return False
        if best is None or value < best[0]:
            best = value, list(choice)
            return True
        return False

    combinations = 1
    for strands in options:
        combinations *= len(strands)
    if combinations <= MAX_COMBINATIONS:
        for choice in product(*options):
            consider(choice)
    else:
        _change_one_at_a_time(options, consider)
    if best is not None:
        return best[1]
    return failure or NoPlan("no combination of action sequences passes the checker")


def _change_one_at_a_time(
    options: Sequence[Sequence[Strand]], consider: Callable[[Sequence[Strand]], bool]
) -> None:
    current = [strands[0] for strands in options]
    consider(current)
    improved = True
    while improved:
        improved = False
        for place, strands in enumerate(options):
            for strand in strands:
                changed = [*current[:place], strand, *current[place + 1 :]]
                if changed != current and consider(changed):
                    current, improved = changed, True


def _evaluate(plan: Plan, world: WorldModel) -> tuple[float, float] | NoPlan:
    """How good the plan is, less is better: its makespan [s], with a charge for what is left in
    baskets, and its work [s], if each actor takes the able robot with the least to do.
    """
    checked = check_plan(plan, world)
    if not checked.valid:
        return NoPlan(checked.violations[0].sentence, checked.violations)
    allocation = least_loaded(plan, checked, world)
    if allocation is None:
        return NoPlan("there are fewer robots than the plan needs at the same time")
    found = AllocatedPlan(plan, checked, allocation, world).valid_schedule()
    if isinstance(found, tuple):
        return NoPlan(found[0].sentence, found)
    unloading_s = UNLOADING_S * len(carried_at_end(checked))
    return round(found.makespan_s + unloading_s, 3), found.work_s


def _plan(problem: PlanningProblem, choice: Sequence[Strand], explored: Exploration | None) -> Plan:
    """The plan of these strands; it promises the conditions of goals that it has strands for."""
    strands = [*choice, *(explored.strands if explored else ())]
    tasks, pins = tasks_from(
        strands, problem.first_task, one_actor_each=problem.strategy == MONOLITHIC
    )
    seeks = frozenset(explored.seeks if explored else ())
    served = {strand.goal for strand in choice}
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
