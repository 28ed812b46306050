"""Plans carried out as programs: what an actor does in a row by itself becomes one task.

Between two tasks of a program nobody is told anything and nobody else waits, so only those are
joined that need no other robot, wait for nobody but each other, and that nobody but each other
waits for. The order of a joined task carries the program of its calls.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence, Set

from msgspec.structs import replace

from fleet.core.checker.plan_checker import CheckedPlan, check_plan
from fleet.core.model.parameter_types import ROBOT
from fleet.core.model.programs import ROBOT_ARGUMENT, TEXT_ARGUMENT
from fleet.core.model.world import WorldModel
from fleet.planners.programs.text import Writer, written
from fleet.planners.programs.writer import MADE_BY
from keyexpr_schema.ids import actor_arg
from keyexpr_schema.payloads.plans import Plan, Task
from keyexpr_schema.payloads.programs import DO, Program, ProgramStep


def joined(checked: CheckedPlan) -> CheckedPlan:
    """The plan with programs for what actors do in a row; as it was, where that is no plan."""
    plan, world = checked.plan, checked.world
    rows: dict[str, list[Task]] = {}
    tasks = {task.task: task for task in plan.tasks}
    for name in checked.graph.order:
        rows.setdefault(tasks[name].actor, []).append(tasks[name])
    becomes: dict[str, str] = {}
    programs: dict[str, Task] = {}
    for row in rows.values():
        for run in _runs(row, checked):
            first = run[0].task
            programs[first] = _as_program(run, checked, world)
            becomes.update((task.task, first) for task in run)
    new = replace(plan, tasks=tuple(_renamed(plan, programs, becomes)))
    again = check_plan(new, world)
    return again if isinstance(again, CheckedPlan) else checked


def _runs(row: Sequence[Task], checked: CheckedPlan) -> Iterable[list[Task]]:
    """An actor's tasks cut where something else comes between them."""
    run: list[Task] = []
    for task in row:
        if not _is_alone(task, checked):
            if run:
                yield run
            run = []
        elif run and _goes_on(run, task, checked):
            run.append(task)
        else:
            if run:
                yield run
            run = [task]
    if run:
        yield run


def _is_alone(task: Task, checked: CheckedPlan) -> bool:
    """Whether it is a call that needs nobody but its robot, and any that has the skill will do."""
    if any(known.skill == task.skill for known in checked.world.hopeless):
        return False
    return task.program is None and len(checked.actions[task.task].participants) == 1


def _goes_on(run: Sequence[Task], task: Task, checked: CheckedPlan) -> bool:
    names = {one.task for one in run}
    graph = checked.graph
    waits_for: Set[str] = graph.predecessors[task.task]
    return (
        task.goal == run[0].goal
        and waits_for <= names
        and all(graph.successors[one] <= {*names, task.task} for one in names)
    )


def _as_program(run: Sequence[Task], checked: CheckedPlan, world: WorldModel) -> Task:
    first = run[0]
    me = actor_arg(first.actor)
    steps = tuple(
        ProgramStep(
            skill=task.skill,
            args={name: ROBOT if value == me else value for name, value in task.args.items()},
        )
        for task in run
    )
    text = "; ".join(
        " ".join([step.skill, *(v for v in step.args.values() if v != ROBOT)]) for step in steps
    )
    able = set(world.skills).intersection(
        *(world.robots[robot].skills for robot in checked.able[first.actor])
    )
    writer = Writer(world.skills, tuple(sorted(able)))
    seconds, here = 0.0, None
    for task in run:
        action = checked.actions[task.task]
        seconds += world.duration_s(action, here, checked.able[first.actor][0])
        if action.skill.travel_to is not None:
            here = action.args[action.skill.travel_to]
    program = Program(
        text=text,
        code=written(text, writer.sequence(steps)),
        made_by=MADE_BY,
        steps=steps,
        duration_s=seconds,
    )
    return replace(
        first,
        skill=DO,
        args={ROBOT_ARGUMENT: me, TEXT_ARGUMENT: text},
        program=program,
        duration_s=seconds,
    )


def _renamed(plan: Plan, programs: dict[str, Task], becomes: dict[str, str]) -> Iterable[Task]:
    for task in plan.tasks:
        if becomes.get(task.task, task.task) != task.task:
            continue  # it is in the program of an earlier one
        made = programs.get(task.task, task)
        after = dict.fromkeys(becomes.get(before, before) for before in made.after)
        yield replace(made, after=tuple(name for name in after if name != task.task))
