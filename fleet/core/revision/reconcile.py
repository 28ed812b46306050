"""From one revision of a plan to the next: what goes on, what is dropped, what is new.

A new plan starts from the facts as they are, so it says again what is already under way. A task of
it that is the same call by the same robot as one under way *is* that one and goes on undisturbed;
one that equals a waiting task keeps its name. What the new plan does not want is dropped: waiting
tasks at once, tasks under way by cancelling their orders, and nothing that touches the same facts
starts before that is confirmed.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from msgspec.structs import replace

from fleet.core import events
from fleet.core.indexes.plan_index import OUTSTANDING
from fleet.core.model.preconditions import effects_hold
from fleet.core.model.task_graph import TaskGraph
from fleet.core.model.world import Call, WorldModel, call_of
from fleet.core.plan_entry import PlanEntry
from keyexpr_schema.ids import bound
from keyexpr_schema.payloads.plans import Plan, PlanChange, Task
from keyexpr_schema.payloads.tasks import ENDED_TASKS, TaskRecord, TaskState


@dataclass(frozen=True)
class Revision:
    """A plan as it is taken over: with the names of tasks that go on, and every record."""

    plan: Plan
    records: dict[str, TaskRecord]
    unwanted: tuple[str, ...]
    missed: tuple[str, ...]
    """Tasks given out since the plan was asked for that it does without."""
    change: PlanChange


def reconcile(entry: PlanEntry, event: events.PlanningSucceeded, world: WorldModel) -> Revision:
    """Take over the plan in `event`, which the entry's present job has made."""
    calls = {task.task: _call(task, event.allocation) for task in event.plan.tasks}
    going_on, skipped = _going_on(entry, event, calls, world)
    names = {**_same_waiting(entry, calls, going_on), **going_on}
    plan = _renamed(event.plan, names)
    records = dict(entry.records)
    for old, task in zip(event.plan.tasks, plan.tasks, strict=True):
        records[task.task] = _record(
            plan, task, calls[old.task], records.get(task.task), event, old.task, names
        )
        if old.task in skipped:
            records[task.task] = replace(
                records[task.task], state=TaskState.SUCCEEDED, reason="it is so already"
            )
    rest = entry.records.keys() - {task.task for task in plan.tasks}
    unwanted = tuple(n for n, r in entry.records.items() if n in rest and r.state in OUTSTANDING)
    waiting = [name for name in rest if entry.records[name].state is TaskState.WAITING]
    for name in waiting:
        records[name] = replace(
            records[name], state=TaskState.CANCELLED, reason="not in the new plan"
        )
    # A task that is so already may have been waiting: then it is kept, and counts once.
    added = sum(task.task not in {*names, *skipped} for task in event.plan.tasks)
    dropped = len(unwanted) + len(waiting)
    found = set(going_on.values())
    # What was under way when the job began, the new plan is without on purpose.
    new = entry.given_out.keys() - set(entry.job.under_way if entry.job else ())
    missed = tuple(name for name in _under_way(entry, sorted(new)) if name not in found)
    change = PlanChange(kept=len(names), dropped=dropped, added=added)
    return Revision(plan, records, unwanted, missed, change)


def _under_way(entry: PlanEntry, started: Iterable[str]) -> Iterator[str]:
    """Those of the tasks that a new plan can go on with: they are done, or being done, and not
    being cancelled."""
    for name in started:
        state = entry.records[name].state
        if state in {*OUTSTANDING, TaskState.SUCCEEDED} and name not in entry.unwanted:
            yield name


def _call(task: Task, allocation: Mapping[str, str]) -> Call:
    return call_of(task.skill, {n: bound(value, allocation) for n, value in task.args.items()})


def _call_of(record: TaskRecord) -> Call:
    return call_of(record.skill, record.args)


def _going_on(
    entry: PlanEntry,
    event: events.PlanningSucceeded,
    calls: Mapping[str, Call],
    world: WorldModel,
) -> tuple[dict[str, str], frozenset[str]]:
    """New tasks that are already under way, with their old names; and what need not be done again.

    A task under way can only be one of the new plan if all that comes before it there holds
    already; those tasks are skipped.
    """
    graph = TaskGraph(
        {
            task.task: {*task.after, *event.extra_after.get(task.task, ())}
            for task in event.plan.tasks
        }
    )
    under_way: dict[Call, list[str]] = {}
    job = entry.job
    started = dict.fromkeys((*(job.under_way if job else ()), *entry.given_out))
    for name in _under_way(entry, started):
        under_way.setdefault(_call_of(entry.records[name]), []).append(name)
    names: dict[str, str] = {}
    found = ended = skipped = graph.mask(())
    for task in graph.order:
        if not under_way.get(calls[task]):
            continue
        before = graph.before(task) & ~ended
        if not before & found and all(
            _holds_already(calls[name], world) for name in graph.named(before)
        ):
            # The same call twice: in the order in which they were given out.
            names[task] = old = under_way[calls[task]].pop(0)
            found |= graph.mask((task,))
            if entry.records[old].state in ENDED_TASKS:
                ended |= graph.mask((task,))
            skipped |= before
    return names, frozenset(graph.named(skipped))


def _holds_already(call: Call, world: WorldModel) -> bool:
    skill = world.skills.get(call[0])
    return skill is not None and effects_hold(skill.ground(dict(call[1])), world)


def _same_waiting(
    entry: PlanEntry, calls: Mapping[str, Call], going_on: Mapping[str, str]
) -> dict[str, str]:
    waiting: dict[Call, list[str]] = {}
    for name, record in entry.records.items():
        if record.state is TaskState.WAITING:
            waiting.setdefault(_call_of(record), []).append(name)
    names: dict[str, str] = {}
    for task, call in calls.items():
        if task not in going_on and waiting.get(call):
            names[task] = waiting[call].pop(0)
    return names


def _renamed(plan: Plan, names: Mapping[str, str]) -> Plan:
    return replace(
        plan,
        tasks=tuple(
            replace(
                task,
                task=names.get(task.task, task.task),
                after=tuple(names.get(before, before) for before in task.after),
            )
            for task in plan.tasks
        ),
    )


def _record(
    plan: Plan,
    task: Task,
    call: Call,
    known: TaskRecord | None,
    event: events.PlanningSucceeded,
    made_as: str,
    names: Mapping[str, str],
) -> TaskRecord:
    record = TaskRecord(
        plan=plan.plan,
        revision=plan.revision,
        task=task.task,
        skill=task.skill,
        args=dict(call[1]),
        actor=task.actor,
        robot=event.allocation[task.actor],
        state=TaskState.WAITING,
        after=task.after,
        behind=tuple(names.get(b, b) for b in event.extra_after.get(made_as, ())),
        goal=task.goal,
        duration_s=event.durations_s.get(made_as, task.duration_s),
        program=task.program,
    )
    if known is None:
        return record
    # An order that stands keeps the revision it was given in, or its worker would refuse it.
    return replace(
        known,
        revision=known.revision if known.state in OUTSTANDING else plan.revision,
        actor=record.actor,
        after=record.after,
        behind=record.behind,
        goal=record.goal,
    )
