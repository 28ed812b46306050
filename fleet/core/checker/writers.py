"""Which tasks write which state variables, and which of their writes may be seen when."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping

from fleet.core.model.formulas.effects import Guarded, instances
from fleet.core.model.skills import Action
from fleet.core.model.task_graph import TaskGraph
from fleet.core.model.world import WorldModel
from keyexpr_schema.facts import FactKey, Literal, Value


class Writers:
    """The writes of a plan's tasks: `plain` ones by variable, in the graph's order, each task with
    its value; `guarded` ones, which depend on what holds when the task ends, by task."""

    def __init__(self, graph: TaskGraph, actions: Mapping[str, Action], world: WorldModel) -> None:
        self._graph, self._actions = graph, actions
        self.plain: dict[FactKey, list[tuple[str, Value]]] = defaultdict(list)
        self.guarded: dict[str, tuple[Guarded, ...]] = {}
        self._by_value: dict[FactKey, dict[Value, int]] = defaultdict(dict)
        self._plain_mask: dict[FactKey, int] = defaultdict(int)
        self._guarded_mask: dict[FactKey, int] = defaultdict(int)
        self._values: dict[FactKey, dict[str, Value]] = defaultdict(dict)
        self._open_values: dict[FactKey, set[Value]] = defaultdict(set)
        self.numeric: set[FactKey] = set()
        """Variables that are added to, so that they may have any value."""
        for task in graph.order:
            bit = graph.mask((task,))
            for variable, value in actions[task].after:
                self.plain[variable].append((task, value))
                self._plain_mask[variable] |= bit
                same = self._by_value[variable]
                same[value] = same.get(value, 0) | bit
                self._values[variable][task] = value
            rows = tuple(row for e in actions[task].conditional for row in instances(e, world))
            if rows:
                self.guarded[task] = rows
            for row in rows:
                self._guarded_mask[row.variable] |= bit
                if row.to is None:
                    self._open_values[row.variable].add(row.value)
                else:
                    self.numeric.add(row.variable)

    def plain_of(self, task: str) -> tuple[Literal, ...]:
        """What the task makes true in any case."""
        return self._actions[task].after

    @property
    def variables(self) -> Iterator[FactKey]:
        """Every variable that some task writes, or may."""
        yield from self._plain_mask
        yield from self._guarded_mask

    def mask(self, variable: FactKey) -> int:
        """Every task that writes it, or may."""
        return self._plain_mask.get(variable, 0) | self._guarded_mask.get(variable, 0)

    def plain_mask(self, variable: FactKey) -> int:
        """The tasks that write it in any case."""
        return self._plain_mask.get(variable, 0)

    def by_value(self, variable: FactKey) -> Mapping[Value, int]:
        """The tasks that write it in any case, as a bit set for each value."""
        return self._by_value.get(variable, {})

    def guarded_mask(self, variable: FactKey) -> int:
        """The tasks that write it depending on what holds."""
        return self._guarded_mask.get(variable, 0)

    def value(self, task: str, variable: FactKey) -> Value:
        """What the task makes of it in any case."""
        return self._values[variable][task]

    def values(self, variable: FactKey) -> set[Value]:
        """Whatever any task may make of it; of one that is added to, not all."""
        return {
            *self._values.get(variable, {}).values(),
            *self._open_values.get(variable, ()),
        }

    def seen(self, variable: FactKey, task: str | None) -> tuple[int, bool]:
        """The tasks, as a bit set, of which one may be the last to have written the variable when
        `task` begins (`None`: when all is done), and whether it may be as at the start.

        Left out is what is necessarily overwritten before.
        """
        graph = self._graph
        here = self.mask(variable)
        before = here
        if task is not None:
            here &= ~(graph.behind(task) | graph.mask((task,)))
            before = here & graph.before(task)
        sure = before & self._plain_mask.get(variable, 0)
        for last in graph.last_of(sure):
            here &= ~graph.before(last)
        return here, sure == 0
