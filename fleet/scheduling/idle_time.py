"""How much of a plan's time robots stand idle, by two definitions, predicted and measured.

The reference's (RobotFleet, Gupta et al. 2025, its `robotctl plan get --analyze-idle`): every task
takes one step, in each step every robot takes the first of its tasks that waits for nothing, and
only robots that have tasks count. It is 0 for a plan that gives everything to one robot.

Ours counts real durations and every robot that could have taken part. For fixed durations and no
ways, the least of it is the least makespan; that is why it belongs beside makespan ÷ lower bound.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from fleet.core.model.task_graph import TaskGraph
from keyexpr_schema.ids import actor_in
from keyexpr_schema.payloads.plans import Plan
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.tasks import TaskRecord, TaskState

Span = tuple[float, float]
"""Start and end, s."""


@dataclass(frozen=True)
class IdleTime:
    """How long the whole took, and how long each robot that counts was busy; both in s, or, by the
    reference's definition, in steps."""

    makespan: float
    busy: Mapping[str, float]

    @property
    def idle(self) -> dict[str, float]:
        """Share of the makespan in which each robot does nothing, 0 to 1."""
        if self.makespan <= 0:
            return dict.fromkeys(self.busy, 0.0)
        return {robot: max(0.0, 1 - busy / self.makespan) for robot, busy in self.busy.items()}

    @property
    def mean(self) -> float:
        """Mean of the robots' shares; 0 where no robot counts."""
        return sum(self.idle.values()) / len(self.busy) if self.busy else 0.0


def capable(plan: Plan, specs: Iterable[RobotSpec]) -> tuple[str, ...]:
    """Robots that have the skill of some task of the plan: those that could have taken part."""
    skills = {task.skill for task in plan.tasks}
    return tuple(sorted(spec.robot for spec in specs if not skills.isdisjoint(spec.skills)))


def unit_idle(robot_of: Mapping[str, str], after: Mapping[str, Iterable[str]]) -> IdleTime:
    """The reference's definition. `robot_of` has the tasks in their order; `after` what each waits
    for (tasks that are not there are done).

    Raises:
        Cycle: tasks wait for each other.
    """
    TaskGraph({task: {b for b in after.get(task, ()) if b in robot_of} for task in robot_of})
    tasks_of: dict[str, list[str]] = defaultdict(list)
    for task, robot in robot_of.items():
        tasks_of[robot].append(task)
    busy = {robot: float(len(tasks)) for robot, tasks in tasks_of.items()}
    left = set(robot_of)
    steps = 0
    while left:
        begun = []
        for tasks in tasks_of.values():
            ready = (task for task in tasks if left.isdisjoint(after.get(task, ())))
            first = next(ready, None)
            if first is not None:
                tasks.remove(first)
                begun.append(first)
        left.difference_update(begun)
        steps += 1
    return IdleTime(float(steps), busy)


def predicted_unit(plan: Plan, allocation: Mapping[str, str]) -> IdleTime:
    """The reference's definition of a plan and its allocation (actor to robot)."""
    return unit_idle(
        {task.task: allocation[task.actor] for task in plan.tasks},
        {task.task: task.after for task in plan.tasks},
    )


def predicted_spans(
    plan: Plan, allocation: Mapping[str, str], sequence: Mapping[str, Sequence[str]]
) -> dict[str, Span]:
    """When each task would start and end, s from the start: at the earliest, with each task's
    `duration_s`, its way included, and robots taking their actors in the order of `sequence`.
    """
    tasks = {task.task: task for task in plan.tasks}
    own = TaskGraph({task.task: set(task.after) for task in plan.tasks})
    first: dict[str, str] = {}
    last: dict[str, str] = {}
    for name in own.order:
        for actor in _actors(tasks[name].actor, tasks[name].args.values()):
            first.setdefault(actor, name)
            last[actor] = name
    after = {task.task: set(task.after) for task in plan.tasks}
    for actors in sequence.values():
        there = [actor for actor in actors if actor in first]
        for one, other in pairwise(there):
            after[first[other]].add(last[one])
    return TaskGraph(after).earliest({name: task.duration_s for name, task in tasks.items()})


def predicted_idle(
    plan: Plan,
    allocation: Mapping[str, str],
    sequence: Mapping[str, Sequence[str]],
    fleet: Iterable[str],
) -> IdleTime:
    """Our definition, of a plan and its allocation; `fleet` are the robots that could take part."""
    spans = predicted_spans(plan, allocation, sequence)
    spans_of: dict[str, list[Span]] = {robot: [] for robot in fleet}
    for task in plan.tasks:
        for actor in _actors(task.actor, task.args.values()):
            spans_of.setdefault(allocation[actor], []).append(spans[task.task])
    makespan_s = max((end_s for _, end_s in spans.values()), default=0.0)
    return IdleTime(makespan_s, {robot: union_s(rows) for robot, rows in spans_of.items()})


def measured_unit(records: Iterable[TaskRecord]) -> IdleTime:
    """The reference's definition, of the tasks that were done, by the robots that did them."""
    done = [
        record
        for record in records
        if record.state is TaskState.SUCCEEDED and record.started_s is not None
    ]
    return unit_idle(
        {record.task: record.robot for record in done if record.robot is not None},
        {record.task: record.after for record in done},
    )


def measured_idle(records: Sequence[TaskRecord], fleet: Iterable[str]) -> IdleTime:
    """Our definition, of what has happened so far.

    The makespan runs from the first order to the last end. A robot is busy while at least one task
    that it takes part in runs, tries of earlier attempts included. `fleet` are the robots that
    could take part.
    """
    begins = [
        min(t for t in (record.ordered_s, record.started_s) if t is not None)
        for record in records
        if record.ordered_s is not None or record.started_s is not None
    ]
    ends = [record.ended_s for record in records if record.ended_s is not None]
    makespan_s = max(0.0, max(ends) - min(begins)) if begins and ends else 0.0
    spans_of: dict[str, list[Span]] = {robot: [] for robot in fleet}
    for record in records:
        if record.robot is not None:
            spans_of.setdefault(record.robot, [])
    for record in records:
        for robot in {record.robot, *record.args.values()} & spans_of.keys():
            spans_of[str(robot)].extend(_spans(record))
    return IdleTime(makespan_s, {robot: union_s(spans) for robot, spans in spans_of.items()})


def union_s(spans: Iterable[Span]) -> float:
    """The length of the union of intervals, s."""
    total_s, reached_s = 0.0, float("-inf")
    for start_s, end_s in sorted(spans):
        total_s += max(0.0, end_s - max(start_s, reached_s))
        reached_s = max(reached_s, end_s)
    return total_s


def _actors(actor: str, args: Iterable[str]) -> tuple[str, ...]:
    """Everyone who takes part in a task, who does it first."""
    others = (other for arg in args if (other := actor_in(arg)) is not None)
    return tuple(dict.fromkeys([actor, *others]))


def _spans(record: TaskRecord) -> list[Span]:
    spans = [(each.started_s, each.ended_s) for each in record.tries]
    if record.started_s is not None and record.ended_s is not None:
        spans.append((record.started_s, record.ended_s))
    return spans
