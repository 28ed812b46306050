"""Deordering: from sequences of actions of certain robots to a DAG of tasks of actors."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import repeat
from typing import NamedTuple

from fleet.core.model.formulas.abstraction import reads
from fleet.core.model.formulas.effects import Guarded, instances
from fleet.core.model.formulas.evaluation import expanded
from fleet.core.model.formulas.nodes import Holds
from fleet.core.model.preconditions import made_true
from fleet.core.model.skills import Action
from fleet.core.model.task_graph import TaskGraph
from fleet.core.model.world import WorldModel, capacity, condition_holds
from keyexpr_schema.facts import AT, FactKey, Value
from keyexpr_schema.ids import actor_arg, bare_name
from keyexpr_schema.payloads.goals import Precedence
from keyexpr_schema.payloads.plans import Task


class Origin(NamedTuple):
    """The sequence that an action of a joined one comes from: its goal, and a number."""

    goal: str
    part: int


@dataclass(frozen=True)
class ActionSequence:
    """Consecutive actions for one goal; each robot in it becomes an actor of its own.

    `named` are robots that the goal itself speaks of: their actors are pinned to them. Where
    sequences for several goals were joined, `origins` has one for each action: robots of different
    parts become different actors, but for those that are `shared`.
    """

    goal: str
    actions: tuple[Action, ...]
    named: frozenset[str] = frozenset()
    origins: tuple[Origin, ...] = ()
    shared: frozenset[str] = frozenset()

    @property
    def with_origins(self) -> Iterator[tuple[Action, Origin]]:
        """Each action, with where it comes from."""
        alone = Origin(self.goal, 0)
        return zip(self.actions, self.origins or repeat(alone), strict=False)

    @property
    def goals(self) -> frozenset[str]:
        """All that it serves."""
        return frozenset({self.goal, *(origin.goal for origin in self.origins)})

    @property
    def lifted(self) -> tuple[object, ...]:
        """What is the same for sequences that differ only in who does what, named robots aside."""
        roles: dict[str, object] = {}
        for action in self.actions:
            for robot in action.participants:
                roles.setdefault(robot, robot if robot in self.named else len(roles))
        return tuple(
            (
                action.skill.name,
                *(roles.get(value := action.args[name], value) for name in action.skill.parameters),
            )
            for action in self.actions
        )


def deordered(
    sequences: Sequence[ActionSequence],
    first_task: int = 1,
    one_actor_each: bool = False,
    *,
    world: WorldModel | None = None,
    in_order: Sequence[Precedence] = (),
) -> tuple[tuple[Task, ...], dict[str, str]]:
    """Tasks that do what the sequences do, in a partial order, and the actors that are pinned.

    A task waits for the last one before it that wrote what it reads, for those that read what it
    overwrites, and for its robots' earlier tasks in the same sequence (deordering by causal links).
    Each robot becomes a new actor in every sequence, or with `one_actor_each` one in all of them.
    Without a `world`, only what is written in preconditions is known to be read, and not what that
    is read off. What makes true what is second `in_order` also waits for what made the first so.
    """
    rows: dict[str, tuple[str, Action, dict[str, str]]] = {}
    pins: dict[str, str] = {}
    actor_count = 0
    actors: dict[tuple[str, int], str] = {}
    named = frozenset[str]().union(*(sequence.named for sequence in sequences))
    for sequence in sequences:
        if not one_actor_each:
            actors, named = {}, sequence.named
        for action, (goal, part) in sequence.with_origins:
            lifted: dict[str, str] = {}
            for robot in action.participants:
                role = robot, 0 if robot in sequence.shared else part
                if role not in actors:
                    actor_count += 1
                    # Names stay unique over the revisions of a plan, as the task numbers do.
                    revision = f"{first_task}-" if first_task > 1 else ""
                    actors[role] = f"a{revision}{actor_count}"
                    if robot in named:
                        pins[actors[role]] = robot
                lifted[robot] = actor_arg(actors[role])
            rows[f"t{first_task + len(rows)}"] = goal, action, lifted
    touched = _Touched([action for _, action, _ in rows.values()], world)
    after = _dependencies(rows, touched)
    if in_order and world is not None:
        for task, first in _in_order(rows, in_order, world):
            after[task].add(first)
    reduced = TaskGraph(after).reduced()
    tasks = tuple(
        Task(
            task=task,
            skill=action.skill.name,
            args={name: lifted.get(value, value) for name, value in action.args.items()},
            actor=bare_name(lifted[action.actor]),
            after=reduced[task],
            goal=goal,
            duration_s=action.skill.duration_s,
        )
        for task, (goal, action, lifted) in rows.items()
    )
    return tasks, pins


def _dependencies(
    rows: Mapping[str, tuple[str, Action, Mapping[str, str]]], touched: _Touched
) -> dict[str, set[str]]:
    after: dict[str, set[str]] = {}
    writer: dict[FactKey, str] = {}
    readers: dict[FactKey, set[str]] = defaultdict(set)
    last: dict[str, str] = {}
    for task, (_, action, lifted) in rows.items():
        reads, writes = (
            {FactKey(relation, lifted.get(subject, subject)) for relation, subject in variables}
            for variables in (touched.reads(action), touched.writes(action))
        )
        befores = {writer[variable] for variable in reads | writes if variable in writer}
        befores.update(*(readers[variable] for variable in writes))
        befores |= {last[actor] for actor in lifted.values() if actor in last}
        last.update(dict.fromkeys(lifted.values(), task))
        for variable in reads:
            readers[variable].add(task)
        for variable in writes:
            writer[variable], readers[variable] = task, set()
        after[task] = befores
    return after


def _in_order(
    rows: Mapping[str, tuple[str, Action, Mapping[str, str]]],
    in_order: Sequence[Precedence],
    world: WorldModel,
) -> Iterator[tuple[str, str]]:
    """Tasks that make true what is second, each with the one that first made the first so."""
    facts = dict(world.facts)
    passed: dict[Precedence, str] = {}
    in_order = [row for row in in_order if not world.holds(row.first)]
    held = [world.holds(row.then) for row in in_order]
    for task, (_, action, _) in rows.items():
        facts.update(made_true(action, facts, world))
        for number, row in enumerate(in_order):
            holds = condition_holds(facts, row.then, world)
            if holds and not held[number] and row in passed:
                yield task, passed[row]
            held[number] = holds
            if row not in passed and condition_holds(facts, row.first, world):
                passed[row] = task


class _Touched:
    """The variables that actions read and write, of those that any of them may write."""

    def __init__(self, actions: Sequence[Action], world: WorldModel | None) -> None:
        self._world = world
        self._values: dict[FactKey, set[Value]] = defaultdict(set)
        for action in actions:
            for variable, value in action.after:
                self._values[variable].add(value)
            for row in self._guarded(action):
                self._values[row.variable].add(row.value)

    def _guarded(self, action: Action) -> list[Guarded]:
        if self._world is None:
            return []
        return [row for e in action.conditional for row in instances(e, self._world)]

    def _values_of(self, variable: FactKey) -> Collection[Value]:
        known = {self._world.facts.get(variable)} if self._world is not None else set()
        return self._values.get(variable, set()) | known

    def reads(self, action: Action) -> set[FactKey]:
        """What its preconditions, and the conditions of its effects, are read off."""
        found = {literal.variable for literal in action.before}
        if self._world is None:
            return found
        guarded = self._guarded(action)
        for node in (
            *map(Holds, action.before),
            *(expanded(formula, self._world) for formula in action.conditions),
            *(row.when for row in guarded),
            *(row.to for row in guarded if row.to is not None),
        ):
            found |= reads(node, self._values_of, self._world)
        for carrier in action.space_in:
            if carrier in self._world.objects:
                found |= self._in_the_way(carrier, self._world)
        return found

    def _in_the_way(self, carrier: str, world: WorldModel) -> set[FactKey]:
        """Where things are that may be on or in it, if those are more than it takes."""
        where = (FactKey(AT, thing) for thing in world.objects)
        there = {variable for variable in where if carrier in self._values_of(variable)}
        return there if len(there) > capacity(carrier, world) else set()

    def writes(self, action: Action) -> set[FactKey]:
        """What it writes, or may."""
        return {
            *(literal.variable for literal in action.after),
            *(row.variable for row in self._guarded(action)),
        }
