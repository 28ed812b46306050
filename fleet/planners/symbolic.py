"""The symbolic planner: finds plans by search over skill models, with no network.

Every condition of every goal becomes a strand: the cheapest action sequence that makes it true,
and a few different ones (made so by charging for actions that were used before), for instance one
with a helper that carries. Strands are chosen together by the makespan they lead to.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

from fleet.core.binding import least_loaded
from fleet.core.checker import check_plan
from fleet.core.lifting import Strand, tasks_from
from fleet.core.schedule import best_schedule, predicted_duration_s
from fleet.core.skills import Action, Variable
from fleet.core.world_model import WorldModel
from fleet.planners.base import NoPlan, Planner, PlanningProblem
from fleet.planners.search import Facts, cheapest, ground_actions
from keyexpr_schema.goals import Condition
from keyexpr_schema.plans import Plan
from keyexpr_schema.world import NOTHING, Value

ALTERNATIVES = 4
"""Different strands sought for each condition."""
REUSE_CHARGE_S = 200.0
"""What an action costs more for each strand that already uses it; more than any task takes."""
MAX_COMBINATIONS = 64
"""Up to this many combinations are all tried; beyond, one strand is changed at a time."""


@dataclass(frozen=True)
class _Aim:
    goal: str
    condition: Condition


class SymbolicPlanner(Planner):
    """Search over skill models; one DAG for all goals."""

    name = "symbolic"
    strategies = ("big-dag",)

    def _solve(self, problem: PlanningProblem) -> Plan | NoPlan:
        world = problem.world
        aims = _in_order(problem)
        if not aims:
            return _plan(problem, ())
        options: list[list[Strand]] = []
        facts: Facts = dict(world.facts)
        for aim in aims:
            found = _strands(aim, facts, world)
            if not found:
                return NoPlan(_why_not(aim, facts, world))
            strands, facts = found
            options.append(strands)
        return _best_combination(problem, options)


def _in_order(problem: PlanningProblem) -> list[_Aim]:
    """Conditions still to be reached; those whose object a hand holds come first."""
    world = problem.world
    held = {world.value("holding", robot) for robot in world.team}
    aims = [
        _Aim(goal.goal, condition)
        for goal in sorted(problem.goals, key=lambda g: (-g.priority, g.ordinal, g.goal))
        for condition in goal.conditions
        if not world.holds(condition)
    ]
    return sorted(aims, key=lambda aim: aim.condition.subject not in held)


def _strands(aim: _Aim, facts: Facts, world: WorldModel) -> tuple[list[Strand], Facts] | None:
    """Different strands for one condition, the cheapest first, and the facts after that one.

    Where a robot stands is left open at the start, so that every actor begins with the way to its
    work, whatever its robot does before.
    """
    robots = _representatives(aim.condition.subject, facts, world)
    start: Facts = dict(facts)
    for robot in world.robots:
        start[Variable("at", robot)] = None
    if aim.condition.subject in world.robots:
        start[Variable("at", aim.condition.subject)] = None
    held = {
        value
        for robot in robots
        if isinstance(value := facts.get(Variable("holding", robot)), str) and value != NOTHING
    }
    subject = aim.condition.subject
    objects = sorted(held | ({subject} if subject in world.objects else set()))
    actions = ground_actions(world, robots, objects, aim.condition)
    used: dict[tuple[str, tuple[str, ...]], int] = {}

    def cost_s(action: Action, now: Mapping[Variable, Value]) -> float:
        where = now.get(Variable("at", action.actor))
        if where is None:
            where = facts.get(Variable("at", action.actor))
        seconds = predicted_duration_s(action, where, action.actor, world)
        return seconds + REUSE_CHARGE_S * used.get(_signature(action), 0)

    strands: list[Strand] = []
    after: Facts | None = None
    for _ in range(ALTERNATIVES):
        found = cheapest(actions, start, aim.condition, world, cost_s)
        if found is None:
            break
        if after is None:
            after = found.facts
        strand = Strand(aim.goal, found.actions, frozenset({subject} & world.robots.keys()))
        if strand not in strands:
            strands.append(strand)
        for action in found.actions:
            used[_signature(action)] = used.get(_signature(action), 0) + 1
    return (strands, after) if after is not None else None


def _signature(action: Action) -> tuple[str, tuple[str, ...]]:
    return action.skill.name, tuple(action.args.values())


def _representatives(subject: str, facts: Facts, world: WorldModel) -> list[str]:
    """One robot of each kind that is interchangeable now, and the one that is spoken of."""
    kinds: dict[object, str] = {}
    for robot in world.team:
        spec = world.robots[robot]
        kind = (
            spec.skills,
            tuple(sorted(spec.capabilities.items())),
            facts.get(Variable("holding", robot)),
            robot if robot == subject or facts.get(Variable("at", subject)) == robot else None,
        )
        kinds.setdefault(kind, robot)
    return sorted(kinds.values())


def _why_not(aim: _Aim, facts: Facts, world: WorldModel) -> str:
    subject = aim.condition.subject
    if subject in world.objects and facts.get(Variable("at", subject)) is None:
        return (
            f"nobody knows where {subject} is, so {aim.condition} cannot be planned for; "
            "tell it as a statement, such as "
            f'"{world.objects[subject].label} is in the {next(iter(world.places), "kitchen")}"'
        )
    return (
        f"no sequence of skills of the connected robots ({', '.join(world.team)}) "
        f"leads to {aim.condition}"
    )


def _best_combination(
    problem: PlanningProblem, options: Sequence[Sequence[Strand]]
) -> Plan | NoPlan:
    best: tuple[tuple[float, float], Plan] | None = None
    failure: NoPlan | None = None

    def consider(choice: Sequence[Strand]) -> bool:
        nonlocal best, failure
        plan = _plan(problem, choice)
        value = _evaluate(plan, problem.world)
        if isinstance(value, NoPlan):
            failure = failure or value
            return False
        if best is None or value < best[0]:
            best = value, plan
            return True
        return False

    combinations = 1
    for strands in options:
        combinations *= len(strands)
    if combinations <= MAX_COMBINATIONS:
        for choice in product(*options):
            consider(choice)
    else:
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
    if best is not None:
        return best[1]
    return failure or NoPlan("no combination of action sequences passes the checker")


def _evaluate(plan: Plan, world: WorldModel) -> tuple[float, float] | NoPlan:
    """Makespan and work of the plan if each actor takes the able robot with the least to do."""
    checked = check_plan(plan, world)
    if not checked.valid:
        return NoPlan(checked.violations[0].sentence, checked.violations)
    allocation = least_loaded(plan, checked, world)
    if allocation is None:
        return NoPlan("there are fewer robots than the plan needs at the same time")
    found = best_schedule(plan, checked, allocation, world)
    if found is None:
        return NoPlan("robots would wait for each other for ever")
    final = check_plan(plan, world, allocation, found.extra_after)
    if not final.valid:
        return NoPlan(final.violations[0].sentence, final.violations)
    return round(found.makespan_s, 3), found.work_s


def _plan(problem: PlanningProblem, strands: Sequence[Strand]) -> Plan:
    tasks, pins = tasks_from(strands, problem.first_task)
    return Plan(
        plan=problem.plan,
        revision=problem.revision,
        goals=tuple(goal.goal for goal in problem.goals),
        conditions=tuple(c for goal in problem.goals for c in goal.conditions),
        tasks=tasks,
        pins=pins,
        strategy=problem.strategy,
        made_by="symbolic",
        allocator=problem.allocator,
    )
