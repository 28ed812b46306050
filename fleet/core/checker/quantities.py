"""Counts: how full a basket may be when a task begins, in the worst order that the graph allows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from fleet.core.model.skills import Action
from fleet.core.model.task_graph import TaskGraph
from fleet.core.model.world import WorldModel
from keyexpr_schema.facts import AT, HOLDING, FactKey, Value

Writes = Mapping[FactKey, Sequence[tuple[str, Value]]]
"""By variable: the tasks that write it, in the graph's order, each with the value."""


class BasketLoads:
    """What is in baskets before tasks: objects at the robot that are not in its hand."""

    def __init__(self, world: WorldModel, graph: TaskGraph, writes: Writes) -> None:
        self._world, self._graph = world, graph
        self._moves = {
            thing: rows for thing in world.objects if (rows := writes.get(FactKey(AT, thing)))
        }
        self._things: dict[Value, set[str]] = {}
        """By where they are at the start, or come to be."""
        for thing in world.objects:
            places = {world.value(AT, thing), *(to for _, to in self._moves.get(thing, ()))}
            for place in places:
                self._things.setdefault(place, set()).add(thing)

    def before(self, task: str, action: Action, carrier: str) -> tuple[int, int]:
        """Objects in the carrier's basket when the task begins: that are there at the start, and
        that other tasks may have put there; what the task itself puts there aside.
        """
        precedes = self._graph.precedes
        own = {
            literal.variable.subject
            for literal in action.after
            if literal.variable.relation == AT and literal.value == carrier
        }
        at_start = planned = 0
        for thing in self._things.get(carrier, set()) - own:
            rows = self._moves.get(thing, ())
            if any(
                value == carrier
                and writer != task
                and not precedes(task, writer)
                and not any(
                    other != carrier and precedes(writer, w) and precedes(w, task)
                    for w, other in rows
                )
                for writer, value in rows
            ):
                planned += 1
            elif (
                self._world.value(AT, thing) == carrier
                and self._world.value(HOLDING, carrier) != thing
                and not any(precedes(writer, task) for writer, _ in rows)
            ):
                at_start += 1
        return at_start, planned

    def unloaded_before(self, task: str, variable: FactKey) -> bool:
        """Whether an object that is in some basket at the start is out of it before the task."""
        if variable.relation != AT:
            return False
        holder = self._world.value(AT, variable.subject)
        in_hand = self._world.value(HOLDING, str(holder)) == variable.subject
        rows = self._moves.get(variable.subject, ())
        return not in_hand and any(self._graph.precedes(writer, task) for writer, _ in rows)
