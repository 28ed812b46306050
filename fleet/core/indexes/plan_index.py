"""What is derived from a plan and its records, so that an event need not walk through them.

`PlanGraph` holds what a revision's tasks say, `PlanIndex` how far its records have come: open
predecessors, ready tasks by robot, counts by goal, robot and actor, and which facts unfinished
tasks need with nothing left before them that provides them. `PlanIndex.of` counts all anew; `moved`
takes one record's change into account. Both come to the same, which is a test.
"""

from __future__ import annotations

from bisect import insort
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping
from functools import partial
from math import inf
from typing import Any, TypeVar

import immutables
import msgspec
from msgspec.structs import replace

from fleet.core.model.durations import late_at_s
from fleet.core.model.preconditions import ANY, action_of, spoken_of, written_by
from fleet.core.model.skills import Skills
from fleet.core.model.task_graph import TaskGraph
from fleet.core.table import Table
from keyexpr_schema.facts import FactKey
from keyexpr_schema.payloads.tasks import ENDED_TASKS, TaskRecord, TaskState

K = TypeVar("K")
Counts = immutables.Map[K, int]
OUTSTANDING = frozenset({TaskState.ORDERED, TaskState.RUNNING})
"""Tasks that a robot has an order for."""


def robots_of(record: TaskRecord) -> frozenset[str]:
    """Whom a task may concern: its robot, and whatever else its arguments name."""
    return frozenset(name for name in (record.robot, *record.args.values()) if name is not None)


class PlanGraph:
    """What a revision's tasks say of each other; it does not change while the revision runs.

    `position` is each task's place in the plan, `successors` the tasks that wait for it. `needs`
    are the values that a task needs of variables; `suppliers` the last tasks before it that set
    such a variable, `consumers` the tasks and variables that a task is such a supplier of.
    `setters` are all tasks that set a variable. What is said of all or some of a type of things is
    of the subject `ANY`.
    """

    def __init__(
        self, tasks: Iterable[str], records: Mapping[str, TaskRecord], skills: Skills
    ) -> None:
        current = {task: records[task] for task in tasks if task in records}
        # A task that was added may wait for one of a revision before.
        befores = {
            name: tuple(dict.fromkeys(b for b in (*record.after, *record.behind) if b in records))
            for name, record in current.items()
        }
        graph = TaskGraph(
            {name: [b for b in waits_for if b in current] for name, waits_for in befores.items()}
        )
        self.position = {name: number for number, name in enumerate(current)}
        self.befores: Mapping[str, tuple[str, ...]] = befores
        successors: dict[str, list[str]] = defaultdict(list)
        for name, waits_for in befores.items():  # in the plan's order
            for before in waits_for:
                successors[before].append(name)
        self.successors = {name: tuple(later) for name, later in successors.items()}
        self.needs: dict[str, tuple[FactKey, ...]] = {}
        self.setters: dict[FactKey, list[str]] = defaultdict(list)
        for name, record in current.items():
            action = action_of(record, skills)
            if action is not None:
                read = [literal.variable for literal in action.before]
                read += [key for formula in action.conditions for key in spoken_of(formula)]
                self.needs[name] = tuple(dict.fromkeys(read))
                for variable in dict.fromkeys(written_by(action)):
                    self.setters[variable].append(name)
        self.suppliers: dict[tuple[str, FactKey], tuple[str, ...]] = {}
        self.consumers: dict[str, list[tuple[str, FactKey]]] = defaultdict(list)
        masks: dict[FactKey, int] = defaultdict(int)
        for variable, names in self.setters.items():
            masks[variable] = graph.mask(names)
        for name, variables in self.needs.items():
            for variable in variables:
                mask = masks.get(variable, 0) | masks.get(FactKey(variable.relation, ANY), 0)
                if mask and (last := graph.last_before(name, mask)):
                    self.suppliers[name, variable] = last
                    for supplier in last:
                        self.consumers[supplier].append((name, variable))


class PlanIndex(msgspec.Struct, frozen=True, eq=False):
    """How far a plan's records have come.

    `open` counts what a waiting task still waits for; `ready` has, by robot, the waiting tasks that
    wait for nothing but robots, in the plan's order. `unfinished` are tasks of the revision that
    have not succeeded, `broken` those that failed or were cancelled, `goal_open` the unfinished
    by goal, `waiting_of` the waiting by the robot that is to do them, `needs` the waiting by whom
    they concern. `outstanding`, `begun`, `todo` and `reserved` are about records of every
    revision: orders, tasks done and waiting by robot and actor, and how many actors a robot has
    begun and has more of. `exposed` has, by variable, tasks not ended that need it and have no
    unfinished supplier. No task becomes late before `late_s`, on the fleet's clock.
    """

    graph: PlanGraph
    open: Counts[str]
    ready: immutables.Map[str, tuple[str, ...]]
    unfinished: int
    broken: int
    waiting: int
    goal_open: Counts[str | None]
    waiting_of: Counts[str | None]
    needs: Counts[str]
    outstanding: Table[str, None]
    begun: Counts[tuple[str, str]]
    todo: Counts[tuple[str, str]]
    reserved: Counts[str]
    exposed: immutables.Map[FactKey, tuple[str, ...]]
    late_s: float = inf

    def __eq__(self, other: object) -> bool:
        # Derived: two entries that are otherwise equal have equal indexes.
        return isinstance(other, PlanIndex)

    __hash__ = None  # type: ignore[assignment]

    @classmethod
    def of(
        cls, tasks: Iterable[str], records: Mapping[str, TaskRecord], graph: PlanGraph
    ) -> PlanIndex:
        """The index of a plan with these current tasks and records of every revision."""
        current = [records[task] for task in tasks if task in records]
        open_ = {
            r.task: sum(_unmet(records, before) for before in graph.befores[r.task])
            for r in current
            if r.state is TaskState.WAITING
        }
        ready: dict[str, list[str]] = defaultdict(list)
        needs: Counter[str] = Counter()
        for record in current:
            if open_.get(record.task) == 0:
                for robot in sorted(robots_of(record)):
                    ready[robot].append(record.task)
            if record.task in open_:
                needs.update(robots_of(record))
        begun: Counter[tuple[str, str]] = Counter()
        todo: Counter[tuple[str, str]] = Counter()
        for record in records.values():
            if record.robot is not None:
                begun[record.robot, record.actor] += record.state is TaskState.SUCCEEDED
                todo[record.robot, record.actor] += record.state is TaskState.WAITING
        exposed: dict[FactKey, list[str]] = defaultdict(list)
        for record in current:
            if record.state not in ENDED_TASKS:
                for variable in graph.needs.get(record.task, ()):
                    if not _supplied(graph, records, record.task, variable):
                        exposed[variable].append(record.task)
        return cls(
            graph=graph,
            open=immutables.Map(open_),
            ready=immutables.Map({robot: tuple(names) for robot, names in ready.items()}),
            unfinished=sum(r.state is not TaskState.SUCCEEDED for r in current),
            broken=sum(r.state in (TaskState.FAILED, TaskState.CANCELLED) for r in current),
            waiting=len(open_),
            goal_open=_counts(r.goal for r in current if r.state is not TaskState.SUCCEEDED),
            waiting_of=_counts(r.robot for r in current if r.state is TaskState.WAITING),
            needs=immutables.Map(needs),
            outstanding=Table({n: None for n, r in records.items() if r.state in OUTSTANDING}),
            begun=immutables.Map(+begun),
            todo=immutables.Map(+todo),
            reserved=_counts(robot for robot, actor in begun & todo),
            exposed=immutables.Map({key: tuple(names) for key, names in exposed.items()}),
            late_s=min(map(late_at_s, current), default=inf),
        )

    def moved(
        self, old: TaskRecord | None, new: TaskRecord, records: Mapping[str, TaskRecord]
    ) -> PlanIndex:
        """The index after a record changed from `old` to `new`, as it is in `records` already.

        Only the state, and what an attempt adds, may change: not robot, actor, goal or order.
        """
        before, after = None if old is None else old.state, new.state
        if before is after:
            return self
        changes: dict[str, Any] = {}
        if (before in OUTSTANDING) != (after in OUTSTANDING):
            changes["outstanding"] = (
                self.outstanding.set(new.task, None)
                if after in OUTSTANDING
                else self.outstanding.without(new.task)
            )
        self._count_actor(new, before, after, changes)
        if new.task in self.graph.position:
            self._move_current(new, before, after, records, changes)
        elif new.task in self.graph.successors:
            open_, ready = self._passed_on(new.task, before, after, records)
            changes.update(open=open_, ready=ready)
        return replace(self, **changes)

    def _passed_on(
        self,
        task: str,
        before: TaskState | None,
        after: TaskState,
        records: Mapping[str, TaskRecord],
    ) -> tuple[Counts[str], immutables.Map[str, tuple[str, ...]]]:
        """`open` and `ready`, after a task that others wait for has succeeded, or no longer has."""
        open_, ready, graph = self.open, self.ready, self.graph
        undone = (after is not TaskState.SUCCEEDED) - (before is not TaskState.SUCCEEDED)
        for later in graph.successors.get(task, ()) if undone else ():
            if later in open_:
                open_ = open_.set(later, open_[later] + undone)
                ready = _offered(ready, records[later], open_[later] == 0, graph.position)
        return open_, ready

    def _count_actor(
        self, new: TaskRecord, before: TaskState | None, after: TaskState, changes: dict[str, Any]
    ) -> None:
        if new.robot is None:
            return
        name = new.robot, new.actor
        begun = _step(self.begun, name, before, after, TaskState.SUCCEEDED)
        todo = _step(self.todo, name, before, after, TaskState.WAITING)
        was, now = name in self.begun and name in self.todo, name in begun and name in todo
        changes.update(begun=begun, todo=todo)
        if was != now:
            changes["reserved"] = _add(self.reserved, new.robot, now - was)

    def _move_current(
        self,
        new: TaskRecord,
        before: TaskState | None,
        after: TaskState,
        records: Mapping[str, TaskRecord],
        changes: dict[str, Any],
    ) -> None:
        task, graph = new.task, self.graph
        step = partial(_step, before=before, after=after)
        changes["waiting_of"] = step(self.waiting_of, new.robot, state=TaskState.WAITING)
        changes["waiting"] = (
            self.waiting + (after is TaskState.WAITING) - (before is TaskState.WAITING)
        )
        ended = frozenset({TaskState.FAILED, TaskState.CANCELLED})
        changes["broken"] = self.broken + (after in ended) - (before in ended)
        undone = (after is not TaskState.SUCCEEDED) - (
            before is not TaskState.SUCCEEDED and before is not None
        )
        if undone:
            changes["unfinished"] = self.unfinished + undone
            changes["goal_open"] = _add(self.goal_open, new.goal, undone)
        alive = (after not in ENDED_TASKS) - (before is not None and before not in ENDED_TASKS)
        exposed = self.exposed
        if alive:
            for variable in graph.needs.get(task, ()):
                show = alive > 0 and not _supplied(graph, records, task, variable)
                exposed = _listed(exposed, variable, task, show, graph.position)
            for later, variable in graph.consumers.get(task, ()):
                record = records.get(later)
                show = (
                    record is not None
                    and record.state not in ENDED_TASKS
                    and not _supplied(graph, records, later, variable)
                )
                exposed = _listed(exposed, variable, later, show, graph.position)
            changes["exposed"] = exposed
        open_, ready = self._passed_on(task, before, after, records)
        if (before is TaskState.WAITING) != (after is TaskState.WAITING):
            needs = self.needs
            for name in robots_of(new):
                needs = _add(needs, name, 1 if after is TaskState.WAITING else -1)
            changes["needs"] = needs
            if after is TaskState.WAITING:
                open_ = open_.set(task, sum(_unmet(records, name) for name in graph.befores[task]))
            else:
                open_ = open_.delete(task)
            ready = _offered(ready, new, open_.get(task) == 0, graph.position)
        changes.update(open=open_, ready=ready, late_s=min(self.late_s, late_at_s(new)))


def _unmet(records: Mapping[str, TaskRecord], task: str) -> bool:
    return records[task].state is not TaskState.SUCCEEDED


def _supplied(
    graph: PlanGraph, records: Mapping[str, TaskRecord], task: str, variable: FactKey
) -> bool:
    """Whether something that comes before a task, and has not ended, sets a variable."""
    return any(
        records[supplier].state not in ENDED_TASKS
        for supplier in graph.suppliers.get((task, variable), ())
    )


def _counts(names: Iterable[K]) -> Counts[K]:
    return immutables.Map(Counter(names))


def _add(counts: Counts[K], name: K, number: int) -> Counts[K]:
    total = counts.get(name, 0) + number
    if total:
        return counts.set(name, total)
    return counts.delete(name) if name in counts else counts


def _step(
    counts: Counts[K], name: K, before: TaskState | None, after: TaskState, state: TaskState
) -> Counts[K]:
    """The counts of tasks in `state`, after one has gone from `before` to `after`."""
    number = (after is state) - (before is state)
    return _add(counts, name, number) if number else counts


def _listed(
    lists: immutables.Map[K, tuple[str, ...]],
    name: K,
    task: str,
    there: bool,
    position: Mapping[str, int],
) -> immutables.Map[K, tuple[str, ...]]:
    """The lists, with a task in that of `name` or not, in the order of `position`."""
    known = lists.get(name, ())
    if (task in known) == there:
        return lists
    if there:
        names = list(known)
        insort(names, task, key=position.__getitem__)
        return lists.set(name, tuple(names))
    rest = tuple(other for other in known if other != task)
    return lists.set(name, rest) if rest else lists.delete(name)


def _offered(
    ready: immutables.Map[str, tuple[str, ...]],
    record: TaskRecord,
    there: bool,
    position: Mapping[str, int],
) -> immutables.Map[str, tuple[str, ...]]:
    for robot in robots_of(record):
        ready = _listed(ready, robot, record.task, there, position)
    return ready


EMPTY_INDEX = PlanIndex.of((), {}, PlanGraph((), {}, {}))
"""That of a plan without tasks."""
