"""Deordering: from sequences of actions of certain robots to a DAG of tasks of actors."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from fleet.core.model.skills import Action
from fleet.core.model.task_graph import TaskGraph
from keyexpr_schema.facts import FactKey
from keyexpr_schema.ids import actor_arg, bare_name
from keyexpr_schema.payloads.plans import Task


@dataclass(frozen=True)
class ActionSequence:
    """Consecutive actions for one goal; each robot in it becomes an actor of its own.

    `named` are robots that the goal itself speaks of: their actors are pinned to them.
    """

    goal: str
    actions: tuple[Action, ...]
    named: frozenset[str] = frozenset()

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
    sequences: Sequence[ActionSequence], first_task: int = 1, one_actor_each: bool = False
) -> tuple[tuple[Task, ...], dict[str, str]]:
    """Tasks that do what the sequences do, in a partial order, and the actors that are pinned.

    A task waits for the last one before it that wrote what it reads, for those that read what it
    overwrites, and for its robots' earlier tasks in the same sequence (deordering by causal links).
    Each robot becomes a new actor in every sequence, or with `one_actor_each` one in all of them.
    """
    rows: dict[str, tuple[str, Action, dict[str, str]]] = {}
    pins: dict[str, str] = {}
    actor_count = 0
    actors: dict[str, str] = {}
    named = frozenset[str]().union(*(sequence.named for sequence in sequences))
    for sequence in sequences:
        if not one_actor_each:
            actors, named = {}, sequence.named
        for action in sequence.actions:
            for robot in action.participants:
                if robot not in actors:
                    actor_count += 1
                    # Names stay unique over the revisions of a plan, as the task numbers do.
                    revision = f"{first_task}-" if first_task > 1 else ""
                    actors[robot] = f"a{revision}{actor_count}"
                    if robot in named:
                        pins[actors[robot]] = robot
            lifted = {robot: actor_arg(actors[robot]) for robot in action.participants}
            rows[f"t{first_task + len(rows)}"] = sequence.goal, action, lifted
    reduced = TaskGraph(_dependencies(rows)).reduced()
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
    rows: Mapping[str, tuple[str, Action, Mapping[str, str]]],
) -> dict[str, set[str]]:
    after: dict[str, set[str]] = {}
    writer: dict[FactKey, str] = {}
    readers: dict[FactKey, set[str]] = defaultdict(set)
    last: dict[str, str] = {}
    for task, (_, action, lifted) in rows.items():
        reads, writes = (
            {FactKey(relation, lifted.get(subject, subject)) for (relation, subject), _ in literals}
            for literals in (action.before, action.after)
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
