"""When a plan's tasks end, for one order of its actors after the other: the scheduler's inner loop.

Everything that does not depend on the order is looked up once, and tasks are numbers.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from fleet.core.model.skills import Action
from fleet.core.model.task_graph import TaskGraph
from fleet.core.model.world import WorldModel
from keyexpr_schema.facts import AT, FactKey, Value
from keyexpr_schema.ids import bare_name, bound


class Timetable:
    """Earliest times under an allocation. One robot does its actors one after the other.

    `first` and `last` give each actor's first and last task by its number in the graph's order.
    """

    def __init__(
        self,
        graph: TaskGraph,
        actions: Mapping[str, Action],
        allocation: Mapping[str, str],
        world: WorldModel,
    ) -> None:
        self._world = world
        self._allocation = allocation
        self._start_places: dict[str, Value] = {r: world.value(AT, r) for r in world.robots}
        self._travels: dict[tuple[str, Value, str], float] = {}
        number = {task: i for i, task in enumerate(graph.order)}
        self._before = [[number[b] for b in graph.predecessors[task]] for task in graph.order]
        self._later = [[number[s] for s in graph.successors[task]] for task in graph.order]
        self._rows: list[tuple[str, float, str | None, bool, Value]] = []
        """Of each task: its robot, what it takes besides the way [s], where the way leads, whether
        it says where its robot is then, and where."""
        self.first: dict[str, int] = {}
        self.last: dict[str, int] = {}
        for i, task in enumerate(graph.order):
            action = actions[task]
            for participant in action.participants:
                actor = bare_name(participant)
                self.first.setdefault(actor, i)
                self.last[actor] = i
            self._rows.append(self._row(action))

    def _row(self, action: Action) -> tuple[str, float, str | None, bool, Value]:
        skill = action.skill
        name = action.actor
        robot = bound(name, self._allocation)
        moved = [value for variable, value in action.after if variable == FactKey(AT, name)]
        target = None if skill.travel_to is None else action.args[skill.travel_to]
        seconds = self._world.work_s(robot, skill)
        return robot, seconds, target, bool(moved), moved[-1] if moved else None

    def ends_s(self, groups: Iterable[Sequence[str]]) -> list[float] | None:
        """When each task ends [s], in the graph's order, if robots take groups of actors in this
        order, and a group's actors as given; `None` if they would wait for each other for ever.
        """
        missing = [len(befores) for befores in self._before]
        waits: dict[int, list[int]] = {}
        releases: dict[int, list[int]] = {}
        latest: dict[str, str] = {}
        for group in groups:
            for actor in group:
                robot = self._allocation[actor]
                previous = latest.get(robot)
                latest[robot] = actor
                if previous is None:
                    continue
                task, ahead = self.first[actor], self.last[previous]
                if ahead in self._before[task] or ahead in waits.get(task, ()):
                    continue
                waits.setdefault(task, []).append(ahead)
                releases.setdefault(ahead, []).append(task)
                missing[task] += 1
        return self._pass(missing, waits, releases)

    def _pass(
        self, missing: list[int], waits: dict[int, list[int]], releases: dict[int, list[int]]
    ) -> list[float] | None:
        where = dict(self._start_places)
        ends_s = [0.0] * len(missing)
        ready = [task for task, count in enumerate(missing) if count == 0]
        done = 0
        while ready:
            task = ready.pop()
            done += 1
            start_s = 0.0
            for before in self._before[task]:
                if ends_s[before] > start_s:
                    start_s = ends_s[before]
            for before in waits.get(task, ()):
                if ends_s[before] > start_s:
                    start_s = ends_s[before]
            robot, seconds, target, moved, place = self._rows[task]
            if target is not None:
                seconds += self._travel_s(robot, where.get(robot), target)
            if moved:
                where[robot] = place
            ends_s[task] = start_s + seconds
            for later in (*self._later[task], *releases.get(task, ())):
                missing[later] -= 1
                if missing[later] == 0:
                    ready.append(later)
        return ends_s if done == len(missing) else None

    def _travel_s(self, robot: str, origin: Value, target: str) -> float:
        way = (robot, origin, target)
        seconds = self._travels.get(way)
        if seconds is None:
            seconds = self._travels[way] = self._world.travel_s(robot, origin, target)
        return seconds
