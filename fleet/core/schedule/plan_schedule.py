"""When tasks would run: durations, the order of actors on a robot, and the makespan of a plan."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from itertools import islice, permutations
from math import inf
from typing import TypeVar

from fleet.core.checker.checked_plan import CheckedPlan, check_allocation
from fleet.core.model.skills import Action
from fleet.core.model.task_graph import Cycle, TaskGraph
from fleet.core.model.world import WorldModel
from fleet.core.schedule.actor_order import first_actors
from fleet.core.schedule.timetable import Timetable
from keyexpr_schema.facts import AT, FactKey, Value
from keyexpr_schema.ids import actor_in, bare_name, bound
from keyexpr_schema.payloads.plans import Plan, Violation

T = TypeVar("T")

MAX_ORDERS_CHECKED = 24
"""Orders put to the checker before an allocation is given up, the shortest first."""
EXHAUSTIVE_GROUPS = 5
"""Up to this many groups every order is tried (120); beyond, neighbours are swapped."""


@dataclass(frozen=True)
class Schedule:
    """Predicted start and end of every task [s], with the order of actors on each robot.

    `extra_after` are the dependencies that follow from that order.
    """

    start_s: Mapping[str, float]
    end_s: Mapping[str, float]
    sequence: Mapping[str, tuple[str, ...]]
    extra_after: Mapping[str, tuple[str, ...]]

    @property
    def makespan_s(self) -> float:
        """When the last task ends."""
        return max(self.end_s.values(), default=0.0)

    @property
    def work_s(self) -> float:
        """The sum of all tasks' durations."""
        return sum(end - self.start_s[task] for task, end in self.end_s.items())


def predicted_duration_s(action: Action, origin: Value, robot: str, world: WorldModel) -> float:
    """Seconds that the action takes, started by `robot` from place `origin` (or from anywhere)."""
    skill = action.skill
    travel_s = (
        0.0
        if skill.travel_to is None
        else world.travel_s(robot, origin, action.args[skill.travel_to])
    )
    return world.work_s(robot, skill) + travel_s


def actor_groups(plan: Plan) -> tuple[tuple[str, ...], ...]:
    """Actors that depend on each other, together; groups in the order of their first tasks."""
    leader = {actor: actor for actor in plan.actors}

    def find(actor: str) -> str:
        while leader[actor] != actor:
            leader[actor] = leader[leader[actor]]
            actor = leader[actor]
        return actor

    owner = {task.task: task.actor for task in plan.tasks}
    for task in plan.tasks:
        others = [actor for value in task.args.values() if (actor := actor_in(value)) is not None]
        for other in (*others, *(owner[before] for before in task.after)):
            leader[find(other)] = find(task.actor)
    groups: dict[str, list[str]] = defaultdict(list)
    for actor in leader:
        groups[find(actor)].append(actor)
    return tuple(tuple(members) for members in groups.values())


def best_schedule(checked: CheckedPlan, allocation: Mapping[str, str]) -> Schedule | None:
    """The shortest schedule over orders of groups of actors, or `None` if every order deadlocks."""
    return next(good_schedules(checked, allocation), None)


def good_schedules(
    checked: CheckedPlan,
    allocation: Mapping[str, str],
    under_way: Set[str] = frozenset(),
    ready_s: Mapping[str, float] | None = None,
) -> Iterator[Schedule]:
    """Schedules over orders of groups of actors, the shortest first; none if all deadlock.

    One robot does its actors one after the other. Robots take groups in the same order, so they
    never wait for each other in a circle. Groups with actors that are `under_way`, or that need
    their robot as it is now, come first. `ready_s` says from when on a robot is free, s.
    """
    timetable = Timetable(checked.graph, checked.actions, allocation, checked.world)
    groups = [
        sorted(group, key=timetable.first.__getitem__) for group in actor_groups(checked.plan)
    ]
    ahead = first_actors(checked) | under_way
    head = [group for group in groups if not ahead.isdisjoint(group)]
    rest = [group for group in groups if ahead.isdisjoint(group)]
    orders: Iterable[Sequence[Sequence[str]]]
    if len(groups) <= EXHAUSTIVE_GROUPS:
        fixed = ((*a, *b) for a in permutations(head) for b in permutations(rest))
        orders = sorted(fixed, key=lambda o: _quality(timetable.ends_s(o)))
    else:
        orders = (_swap_neighbours(timetable, head, rest, allocation), [*head, *rest])
    for order in orders:
        found = schedule(checked, allocation, order, ready_s)
        if found is not None:
            yield found


def valid_schedule(
    checked: CheckedPlan,
    allocation: Mapping[str, str],
    under_way: Set[str] = frozenset(),
    ready_s: Mapping[str, float] | None = None,
) -> Schedule | tuple[Violation, ...]:
    """The shortest schedule that passes the checker with robots for actors, or what is wrong.

    Another order than the shortest may be the one that leaves every goal reached. See
    `good_schedules` for `under_way` and `ready_s`.
    """
    violations: tuple[Violation, ...] = ()
    found_orders = good_schedules(checked, allocation, under_way, ready_s)
    for found in islice(found_orders, MAX_ORDERS_CHECKED):
        violations = check_allocation(checked.plan, checked.world, allocation, found.extra_after)
        if not violations:
            return found
    sentence = "with this allocation robots wait for each other for ever"
    return violations or (Violation(code="no-allocation", sentence=sentence),)


def _quality(ends_s: Sequence[float] | None) -> tuple[float, float]:
    """Less is better: the last task's end [s], then the sum of all ends; a deadlock is worst."""
    if ends_s is None:
        return inf, inf
    return round(max(ends_s, default=0.0), 3), sum(ends_s)


def _swap_neighbours(
    timetable: Timetable,
    head: Sequence[Sequence[str]],
    rest: Sequence[Sequence[str]],
    allocation: Mapping[str, str],
) -> Sequence[Sequence[str]]:
    """A good order; every group of `head` stays before every one of `rest`."""
    order = [*head, *rest]
    robots = [{allocation[actor] for actor in group} for group in order]
    best = _quality(timetable.ends_s(order))
    improved = True
    while improved:
        improved = False
        for left in range(len(order) - 1):
            if left + 1 == len(head) or robots[left].isdisjoint(robots[left + 1]):
                continue  # where no robot's own order would change, nothing would
            _swap(order, left)
            quality = _quality(timetable.ends_s(order))
            if quality < best:
                best, improved = quality, True
                _swap(robots, left)
            else:
                _swap(order, left)
    return order


def _swap(items: list[T], left: int) -> None:
    items[left], items[left + 1] = items[left + 1], items[left]


def schedule(
    checked: CheckedPlan,
    allocation: Mapping[str, str],
    groups: Iterable[Sequence[str]],
    ready_s: Mapping[str, float] | None = None,
) -> Schedule | None:
    """The earliest schedule if robots take groups of actors in this order; `None` on deadlock.

    `ready_s` says from when on a robot is free, s.
    """
    graph = checked.graph
    number = {task: i for i, task in enumerate(graph.order)}
    tasks_of: dict[str, list[str]] = defaultdict(list)
    for task in graph.order:
        for participant in checked.actions[task].participants:
            tasks_of[bare_name(participant)].append(task)
    sequence: dict[str, list[str]] = defaultdict(list)
    extra: dict[str, set[str]] = defaultdict(set)
    for group in groups:
        for actor in sorted(group, key=lambda name: number[tasks_of[name][0]]):
            robot = allocation[actor]
            if sequence[robot]:
                extra[tasks_of[actor][0]].add(tasks_of[sequence[robot][-1]][-1])
            sequence[robot].append(actor)
    try:
        whole = TaskGraph(
            {task: graph.predecessors[task] | extra.get(task, set()) for task in graph.order}
        )
    except Cycle:
        return None
    start_s, end_s = _earliest(whole, checked.actions, allocation, checked.world, ready_s or {})
    return Schedule(
        start_s,
        end_s,
        {robot: tuple(actors) for robot, actors in sequence.items()},
        {task: tuple(sorted(befores)) for task, befores in extra.items()},
    )


def _earliest(
    graph: TaskGraph,
    actions: Mapping[str, Action],
    allocation: Mapping[str, str],
    world: WorldModel,
    ready_s: Mapping[str, float],
) -> tuple[dict[str, float], dict[str, float]]:
    where: dict[str, Value] = {robot: world.value(AT, robot) for robot in world.robots}
    start_s: dict[str, float] = {}
    end_s: dict[str, float] = {}
    for task in graph.order:
        action = actions[task]
        robot = bound(action.actor, allocation)
        start = max((end_s[before] for before in graph.predecessors[task]), default=0.0)
        for participant in action.participants if ready_s else ():
            start = max(start, ready_s.get(bound(participant, allocation), 0.0))
        start_s[task] = start
        end_s[task] = start + predicted_duration_s(action, where.get(robot), robot, world)
        for variable, value in action.after:
            if variable == FactKey(AT, action.actor):
                where[robot] = value
    return start_s, end_s
