"""Optimal semi-matching: the evenest loads of unit tasks on robots that cannot all do each of them.

An assignment of unit tasks to robots is an *optimal semi-matching* if no *cost-reducing path*
exists: a chain of tasks, each handed from one robot to the next, from a robot to one with at least
two tasks less. It then has the least maximum load, and after the maximum the least next load, and
so on, and the least sum of any convex cost of loads (Harvey, Ladner, Lovász, Tamir: "Semi-matchings
for bipartite graphs and load balancing", J. Algorithms 59, 2006, theorems 3.1 and 3.5).

Here a path moves many alike tasks at once, between classes of alike robots. Inside a class the load
is spread evenly, so its robots differ by one task at most. Maximum flows for every level of load
would do it, too; where robots can do half of 10,000 tasks, scipy takes three times as long for one
of them as all of this takes, and 250 MB.
"""

from __future__ import annotations

from bisect import bisect_left, insort
from collections import deque
from collections.abc import Sequence
from itertools import cycle, islice, pairwise

from fleet.allocators.load_balancing.robot_sets import Classes, bits

Flow = list[dict[int, int]]
"""For every robot class: how many tasks of each task class it takes."""


def semi_matching(counts: Sequence[int], able: Sequence[int], members: Sequence[int]) -> Flow:
    """Assign unit tasks so that the sorted loads are lexicographically least.

    `counts[i]` tasks are of class `i` and can be done by the robot classes in the set `able[i]`;
    `members[j]` robots are of class `j`. The robots of one class are to share evenly.

    Raises:
        ValueError: there are tasks that no robot can do.
    """
    loads = _ClassLoads(members)
    for i in sorted(range(len(counts)), key=lambda i: able[i].bit_count()):
        if counts[i] and not able[i]:
            raise ValueError(f"no robot can do tasks of class {i}")
        loads.fill(i, counts[i], able[i])
    _cancel_paths(loads, able)
    return loads.flow


def loads_of(flow: Flow, members: Sequence[int]) -> list[int]:
    """The loads of all robots, the greatest first."""
    loads: list[int] = []
    for tasks, size in zip(flow, members, strict=True):
        even, more = divmod(sum(tasks.values()), size)
        loads += [even + 1] * more + [even] * (size - more)
    return sorted(loads, reverse=True)


def robots_of(classes: Classes, flow: Flow) -> list[int]:
    """A robot for every actor of one task; a class deals its actors to its robots in turn."""
    robot = [0] * sum(map(len, classes.actors))
    queues = [iter(actors) for actors in classes.actors]
    for tasks, members in zip(flow, classes.robots, strict=True):
        turn = cycle(members)
        for i, count in tasks.items():
            for actor in islice(queues[i], count):
                robot[actor] = next(turn)
    return robot


class _ClassLoads:
    """Totals and flow of robot classes, and the classes by the load of their idlest robot."""

    def __init__(self, members: Sequence[int]) -> None:
        self.members = members
        self.total = [0] * len(members)
        self.busiest = [0] * len(members)
        """The loads of the busiest robots of the classes."""
        self.flow: Flow = [{} for _ in members]
        self._at: dict[int, int] = {0: (1 << len(members)) - 1}
        self._levels = [0]

    def floor(self, j: int) -> int:
        """The load of the idlest robot of class `j`."""
        return self.total[j] // self.members[j]

    def up_to(self, level: int) -> int:
        """The classes with a robot whose load is at most `level`."""
        mask = 0
        for known in self._levels:
            if known > level:
                break
            mask |= self._at[known]
        return mask

    def fill(self, i: int, count: int, able: int) -> None:
        """Give out tasks of class `i`, each to an able robot with the least load."""
        while count:
            level, found = next((v, m) for v in self._levels if (m := able & self._at[v]))
            j = (found & -found).bit_length() - 1
            room = self.members[j] * (level + 1) - self.total[j]
            if found & (found - 1) == 0:  # the only one: on to where the next one stands
                above = (v for v in self._levels if v > level and able & self._at[v])
                room += self.members[j] * (next(above, level + 1 + count) - level - 1)
            some = min(count, room)
            self.add(i, j, some)
            count -= some

    def add(self, i: int, j: int, some: int) -> None:
        """Give `some` more tasks of class `i` (or less, if negative) to robot class `j`."""
        tasks = self.flow[j]
        tasks[i] = tasks.get(i, 0) + some
        if not tasks[i]:
            del tasks[i]
        before = self.floor(j)
        self.total[j] += some
        self.busiest[j] = -(-self.total[j] // self.members[j])
        after = self.floor(j)
        if before == after:
            return
        self._at[before] ^= 1 << j
        if not self._at[before]:
            del self._at[before]
            del self._levels[bisect_left(self._levels, before)]
        if after not in self._at:
            self._at[after] = 0
            insort(self._levels, after)
        self._at[after] |= 1 << j


def _cancel_paths(loads: _ClassLoads, able: Sequence[int]) -> None:
    """Follow cost-reducing paths until there is none.

    If no path leaves the busiest class, none ever will from what can be reached from it: those
    have loads of at most one less, their tasks cannot go elsewhere, and no path that comes in from
    outside can end there. They are settled, and the rest goes on without them.
    """
    successors = [_able_classes(tasks, able) for tasks in loads.flow]
    open_classes = set(range(len(loads.members)))
    settled = 0
    while open_classes:
        source = max(open_classes, key=loads.busiest.__getitem__)
        top = loads.busiest[source]
        if top <= 1:
            return
        path, seen = _path(source, successors, loads.up_to(top - 2), settled)
        if not path:
            open_classes.difference_update(bits(seen ^ settled))
            settled = seen
            continue
        _augment(path, loads, able)
        for j in path:
            successors[j] = _able_classes(loads.flow[j], able)


def _able_classes(tasks: dict[int, int], able: Sequence[int]) -> int:
    """The robot classes that could do some of these tasks."""
    mask = 0
    for i in tasks:
        mask |= able[i]
    return mask


def _path(
    source: int, successors: Sequence[int], targets: int, settled: int
) -> tuple[list[int], int]:
    """A shortest chain of robot classes from `source` to a target, around those settled.

    If there is none: an empty one, and the settled ones with all that was reached.
    """
    parent = {source: source}
    seen = settled | 1 << source
    queue = deque([source])
    while queue:
        here = queue.popleft()
        if hit := successors[here] & targets:
            path = [(hit & -hit).bit_length() - 1]
            while here != source:
                path.append(here)
                here = parent[here]
            return [source, *reversed(path)], seen
        new = successors[here] & ~seen
        seen |= new
        for there in bits(new):
            parent[there] = here
            queue.append(there)
    return [], seen


def _augment(path: Sequence[int], loads: _ClassLoads, able: Sequence[int]) -> None:
    """Move as many tasks along the path as even out its ends, and its narrowest step allows.

    Up to the point where the ends' mean loads meet, no move makes the loads less even.
    """
    steps = []
    for here, there in pairwise(path):
        tasks = loads.flow[here]
        i = max((i for i in tasks if able[i] >> there & 1), key=tasks.__getitem__)
        steps.append((here, there, i, tasks[i]))
    first, last = path[0], path[-1]
    m, n = loads.members[first], loads.members[last]
    even = (loads.total[first] * n - loads.total[last] * m) // (m + n)
    some = min(max(even, 1), *(room for *_, room in steps))
    for here, there, i, _ in steps:
        loads.add(i, here, -some)
        loads.add(i, there, some)
