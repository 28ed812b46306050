"""What is left of a plan, as a plan: for another allocation, or one more task, without planning."""

from __future__ import annotations

from collections.abc import Set

from msgspec.structs import replace

from fleet.core.indexes.plan_index import OUTSTANDING
from fleet.core.model.durations import only_moves
from fleet.core.model.skills import Skills
from fleet.core.model.task_graph import TaskGraph
from fleet.core.plan_entry import PlanEntry
from keyexpr_schema.facts import CHARGE
from keyexpr_schema.payloads.plans import Plan, Task
from keyexpr_schema.payloads.tasks import ENDED_TASKS, TaskState

HAD_ROBOT = OUTSTANDING | {TaskState.SUCCEEDED}


def residual_plan(
    entry: PlanEntry,
    revision: int,
    gone: Set[str] = frozenset(),
    addition: Task | None = None,
    without: Set[str] = frozenset(),
) -> Plan:
    """The tasks that have not ended and are for goals that the plan still has, under new names, and
    `addition` under its own; not those in `without`.

    Actors whose robot is `gone` begin anew, with everything that they had done. The others stay
    with their robot once they have begun. Whether that is still a plan, the checker has to say.
    """
    anew = {actor for actor, robot in entry.outcome.allocation.items() if robot in gone}
    todo = [
        task
        for task in entry.plan.tasks
        if entry.is_wanted(task)
        and task.task not in entry.by_hand
        and task.task not in without
        and (
            task.actor in anew
            or task.task not in entry.records
            or entry.records[task.task].state not in ENDED_TASKS
        )
    ]
    first = entry.next_task_number + (addition is not None)
    names = {task.task: f"t{first + number}" for number, task in enumerate(todo)}
    if addition is not None:
        todo.append(addition)
        names[addition.task] = addition.task
    tasks = tuple(
        replace(
            task,
            task=names[task.task],
            after=tuple(names[before] for before in task.after if before in names),
        )
        for task in todo
    )
    actors = {task.actor for task in tasks}
    begun = {actor: robot for actor, robot in begun_actors(entry, gone).items() if actor in actors}
    return replace(entry.plan, revision=revision, tasks=tasks, pins={**begun, **entry.plan.pins})


def charging_between(entry: PlanEntry, skills: Skills) -> frozenset[str]:
    """The tasks by which robots charge between others, with the ways there, but those that one is
    at: whether they are needed, each revision finds out anew."""
    found: set[str] = set()
    rest = {r.task: r for r in entry.current() if r.state not in OUTSTANDING}
    own = {c.subject for c in entry.plan.conditions if c.relation == CHARGE}
    for record in rest.values():
        skill = skills.get(record.skill)
        if skill is None or not skill.recharges or record.robot in own:
            continue
        ways = [rest[name] for name in record.after if name in rest]
        ways = [
            way
            for way in ways
            if way.actor == record.actor
            and way.state is record.state
            and (moves := skills.get(way.skill)) is not None
            and only_moves(moves)
        ]
        if ways:
            found.update((record.task, *(way.task for way in ways)))
    return frozenset(found)


def begun_actors(entry: PlanEntry, gone: Set[str] = frozenset()) -> dict[str, str]:
    """The actors of the plan that robots, other than those `gone`, have begun to be."""
    return {
        record.actor: record.robot
        for record in entry.records.values()
        if record.state in HAD_ROBOT
        and record.robot is not None
        and record.robot not in gone
        and entry.outcome.allocation.get(record.actor) == record.robot
    }


def actors_in_order(entry: PlanEntry) -> tuple[str, ...]:
    """The plan's actors by when their first task would start, if all went as predicted."""
    current = {record.task: record for record in entry.current()}
    graph = TaskGraph({task: {*r.after, *r.behind} & current.keys() for task, r in current.items()})
    start_s: dict[str, float] = {}
    spans = graph.earliest({task: record.duration_s for task, record in current.items()})
    for task, (begin_s, _) in spans.items():
        actor = current[task].actor
        start_s[actor] = min(begin_s, start_s.get(actor, begin_s))
    return tuple(sorted(start_s, key=start_s.__getitem__))
