"""Candidate plans: from a model's answers to one deordered plan, and what that must pass."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from msgspec.structs import replace

from fleet.core.actors import least_loaded
from fleet.core.checker.plan_checker import CheckedPlan, InvalidPlan, check_plan
from fleet.core.model.preconditions import made_true
from fleet.core.model.skills import SkillModel
from fleet.core.model.task_graph import TaskGraph
from fleet.core.model.world import WorldModel
from fleet.planners.base import PlanningProblem
from fleet.planners.deordering import ActionSequence, deordered
from fleet.planners.llm.answers import GraphAnswer, ListAnswer, StepAnswer, TaskAnswer
from fleet.scheduling.plan_schedule import AllocatedPlan
from keyexpr_schema.facts import FactKey, Value
from keyexpr_schema.ids import actor_arg, actor_in, bare_name
from keyexpr_schema.payloads.goals import Condition, Goal
from keyexpr_schema.payloads.plans import Plan, Task, Violation


def candidate_of(
    answer: GraphAnswer | ListAnswer,
    problem: PlanningProblem,
    goals: Sequence[Goal],
    world: WorldModel,
    keep: Sequence[Condition] = (),
) -> Plan:
    """The answer as a plan for these goals that leaves alone what `keep` says.

    Tasks are named as the model named them, so that corrections can speak of them; those of a flat
    list wait for one another in its order.
    """
    only = goals[0].goal if len(goals) == 1 else None
    rows: Sequence[StepAnswer] = answer.tasks
    tasks: list[Task] = []
    for row in rows:
        name = row.task if isinstance(row, TaskAnswer) else f"t{len(tasks) + 1}"
        before = (tasks[-1].task,) if tasks else ()
        skill = world.skills.get(row.skill)
        tasks.append(
            Task(
                task=name,
                skill=row.skill,
                args=row.args,
                actor=_actor_of(skill, row.args),
                after=tuple(dict.fromkeys(row.after)) if isinstance(row, TaskAnswer) else before,
                goal=row.goal if only is None else only,
                duration_s=skill.duration_s if skill is not None else 0.0,
            )
        )
    pins = {bare_name(pin.actor): pin.robot for pin in answer.pins}
    actors = {task.actor for task in tasks}
    pins = {actor: robot for actor, robot in pins.items() if actor in actors}
    return _plan(problem, goals, tasks, pins, keep)


def _actor_of(skill: SkillModel | None, args: Mapping[str, str]) -> str:
    """The actor that does a task with these arguments."""
    value = args.get(skill.actor_parameter, "") if skill is not None else ""
    return bare_name(value) or "a1"


def _plan(
    problem: PlanningProblem,
    goals: Sequence[Goal],
    tasks: Sequence[Task],
    pins: dict[str, str],
    keep: Sequence[Condition] = (),
) -> Plan:
    return Plan(
        plan=problem.plan,
        revision=problem.revision,
        goals=tuple(goal.goal for goal in goals),
        conditions=tuple(dict.fromkeys([*conditions_of(goals), *keep])),
        tasks=tuple(tasks),
        pins=pins,
        strategy=problem.strategy,
        made_by="llm",
        allocator=problem.allocator,
        always=problem.always,
        never=problem.never,
        sometime_before=problem.sometime_before,
        by={goal.goal: goal.by for goal in goals if goal.by},
    )


def conditions_of(goals: Sequence[Goal]) -> tuple[Condition, ...]:
    """What must hold at the end, goal by goal."""
    return tuple(condition for goal in goals for condition in goal.conditions)


def merged(candidates: Sequence[Plan], problem: PlanningProblem, keep_order: bool) -> Plan:
    """One plan of checked candidates, with names that are unique over the revisions of the plan.

    Between candidates there is only the order that deordering leaves; within a candidate the
    model's own order is kept, too, if `keep_order`.
    """
    world = problem.world
    sequences: list[ActionSequence] = []
    rows: list[Task] = []
    for candidate in candidates:
        ordered = _in_order(candidate)
        rows.extend(ordered)
        robots = {actor_arg(actor): robot for actor, robot in candidate.pins.items()}
        actions = tuple(
            world.skills[task.skill].ground(
                {name: robots.get(value, value) for name, value in task.args.items()}
            )
            for task in ordered
        )
        sequences.append(ActionSequence("", actions, frozenset(robots.values())))
    tasks, pins = deordered(sequences, problem.first_task, world=world)
    if keep_order:
        tasks = _with_model_order(tasks, rows, candidates)
    tasks = tuple(replace(task, goal=row.goal) for task, row in zip(tasks, rows, strict=True))
    return _plan(problem, problem.goals, tasks, pins)


def _with_model_order(
    tasks: Sequence[Task], rows: Sequence[Task], candidates: Sequence[Plan]
) -> tuple[Task, ...]:
    """The tasks with the model's order added, in the fewest edges."""
    start = 0
    after: dict[str, set[str]] = {task.task: set(task.after) for task in tasks}
    for candidate in candidates:
        here = slice(start, start + len(candidate.tasks))
        start = here.stop
        names = {row.task: task.task for row, task in zip(rows[here], tasks[here], strict=True)}
        for task in candidate.tasks:
            after[names[task.task]] |= {names[before] for before in task.after}
    reduced = TaskGraph(after).reduced()
    return tuple(replace(task, after=reduced[task.task]) for task in tasks)


def world_after(candidate: Plan, world: WorldModel) -> WorldModel:
    """The world after a checked candidate, as far as that is settled before robots are chosen."""
    facts: dict[FactKey, Value] = dict(world.facts)
    settled: dict[FactKey, Value] = {}
    for task in _in_order(candidate):
        for variable, value in made_true(world.skills[task.skill].ground(task.args), facts, world):
            facts[variable] = value
            if actor_in(variable.subject) is None:
                settled[variable] = value if actor_in(value) is None else None
    return world.with_facts(settled)


def _in_order(plan: Plan) -> list[Task]:
    by_name = {task.task: task for task in plan.tasks}
    return [by_name[name] for name in TaskGraph({t.task: t.after for t in plan.tasks}).order]


def verify(plan: Plan, world: WorldModel) -> CheckedPlan | InvalidPlan:
    """The plan, if the checker passes it and some allocation of it can be scheduled."""
    if foreign := _foreign_goals(plan):
        return InvalidPlan(plan, world, foreign)
    checked = check_plan(plan, world)
    if isinstance(checked, InvalidPlan) or not plan.tasks:
        return checked
    allocation = least_loaded(checked)
    if allocation is None:
        return _invalid(
            checked,
            "too-few-robots",
            "there are fewer able robots than the plan needs at the same time: "
            "let the same actor do more of it",
        )
    allocated = AllocatedPlan(checked, allocation)
    found = next(allocated.schedules(), None)
    if found is None:
        return _invalid(
            checked,
            "deadlock",
            "with the robots there are, some would wait for each other for ever: "
            "let actors that meet do less in between",
        )
    violations = allocated.violations(found)
    return InvalidPlan(plan, world, violations) if violations else checked


def _invalid(checked: CheckedPlan, code: str, sentence: str) -> InvalidPlan:
    return InvalidPlan(checked.plan, checked.world, (Violation(code=code, sentence=sentence),))


def _foreign_goals(plan: Plan) -> tuple[Violation, ...]:
    return tuple(
        Violation(
            code="unknown-goal",
            sentence=f"{task.task} is for goal {task.goal}; "
            f"goals are {', '.join(plan.goals) or 'none'}",
            task=task.task,
        )
        for task in plan.tasks
        if task.goal not in plan.goals
    )
