"""One flat list for all goals: each sequence goes on from where those before it left the robots.

Every role of a sequence is taken by the robot that can be there first, of those that are as the
sequence needs them, and a way to where its robot stands already is left out. A robot that still has
something delivered in its basket is not sent away with it, as long as there is another one.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from math import inf

from fleet.core.model.durations import only_moves
from fleet.core.model.skills import Action
from fleet.core.model.world import WorldModel, capacity, known_value
from fleet.planners.deordering import ActionSequence, Origin
from fleet.planners.symbolic.roles import Part, Role, Roles, Step, steps
from keyexpr_schema.facts import AT, HOLDING, FactKey, Value


class Team:
    """The robots as the list so far leaves them: where they are, what they have, when they are
    free [s]."""

    def __init__(self, world: WorldModel, roles: Roles, delivered: Collection[str] = ()) -> None:
        """`delivered` are things that goals speak of."""
        self._world, self._roles, self._delivered = world, roles, frozenset(delivered)
        self._facts: dict[FactKey, Value] = dict(world.facts)
        self._free_s = dict.fromkeys(world.team, 0.0)
        self._begun: set[str] = set()
        self._aboard: dict[str, set[str]] = {robot: set() for robot in world.robots}
        for thing in world.objects:
            robot = world.value(AT, thing)
            if robot in self._aboard and world.value(HOLDING, str(robot)) != thing:
                self._aboard[str(robot)].add(thing)

    def take(self, sequence: ActionSequence) -> tuple[ActionSequence, float]:
        """The sequence as the team does it, and when it is done [s]."""
        robots: dict[Part, str] = {}
        for role in self._roles.of(sequence):
            taken = frozenset(robots.values())
            robots[role.who] = self._chosen(role, taken) or role.who.robot
        rows: list[tuple[Action, Origin]] = []
        end_s = 0.0
        for step, (_, origin) in zip(steps(sequence), sequence.with_origins, strict=True):
            action = _done_by(step, robots)
            target = action.skill.travel_to
            if (
                only_moves(action.skill)
                and action.actor in self._begun
                and self._value(AT, action.actor) == action.args[str(target)]
            ):
                continue
            rows.append((action, origin))
            end_s = max(end_s, self._carry_out(action))
        bound = replace(
            sequence,
            actions=tuple(action for action, _ in rows),
            origins=tuple(origin for _, origin in rows) if sequence.origins else (),
            shared=frozenset(robots.values()) if sequence.origins else sequence.shared,
        )
        return bound, end_s

    def _value(self, relation: str, subject: str) -> Value:
        return known_value(FactKey(relation, subject), self._facts, self._world)

    def _chosen(self, role: Role, taken: Collection[str]) -> str | None:
        """The robot that can be there first; `None` if there is none."""
        if role.particular:
            return role.who.robot
        best, least = None, (2, inf)
        for robot in self._world.team:
            if robot not in role.able or robot in taken or not self._is_fit(role, robot):
                continue
            loaded = not self._delivered.isdisjoint(self._aboard[robot] - role.brings)
            there_s = self._free_s[robot]
            if role.starts_at is not None:
                origin = self._value(AT, robot)
                if origin != role.starts_at:
                    there_s += self._world.travel_s(robot, origin, role.starts_at)
            if (loaded, there_s) < least:
                best, least = robot, (int(loaded), there_s)
        return best

    def _is_fit(self, role: Role, robot: str) -> bool:
        aboard = self._aboard[robot]
        return (
            all(self._value(AT, thing) == robot for thing in role.brings)
            and all(self._value(name, robot) == value for name, value in role.needs.items())
            and (
                not role.loads
                or len(aboard - role.brings) + role.loads <= capacity(robot, self._world)
            )
        )

    def _carry_out(self, action: Action) -> float:
        """When it ends."""
        start_s = max(self._free_s.get(robot, 0.0) for robot in action.participants)
        origin = self._value(AT, action.actor)
        end_s = start_s + self._world.duration_s(action, origin, action.actor)
        for robot in action.participants:
            self._free_s[robot] = end_s
            self._begun.add(robot)
        for variable, value in action.after:
            self._facts[variable] = value
        for (relation, thing), value in action.after:
            if relation != AT or thing not in self._world.objects:
                continue
            for row in self._aboard.values():
                row.discard(thing)
            if value in self._aboard and self._value(HOLDING, str(value)) != thing:
                self._aboard[str(value)].add(thing)
        return end_s


def in_one_list(
    sequences: Sequence[ActionSequence],
    world: WorldModel,
    roles: Roles,
    delivered: Collection[str],
    in_order: bool,
) -> list[ActionSequence]:
    """The sequences as one list, done by the team of the `world`; those that leave something in a
    basket come last, unless all are to stay `in_order`."""
    team = Team(world, roles, delivered)
    rows = sequences if in_order else _loads_last(sequences, roles)
    return [team.take(sequence)[0] for sequence in rows]


def _loads_last(sequences: Sequence[ActionSequence], roles: Roles) -> list[ActionSequence]:
    """Those that leave something in a basket last, unless another one is about the same thing."""
    stay: list[ActionSequence] = []
    last: list[ActionSequence] = []
    things = [_arguments(sequence) for sequence in sequences]
    times: dict[str, int] = {}
    for row in things:
        for name in row:
            times[name] = times.get(name, 0) + 1
    for sequence in sequences:
        left = frozenset[str]().union(*(role.leaves for role in roles.of(sequence)))
        alone = bool(left) and all(times[thing] == 1 for thing in left)
        (last if alone else stay).append(sequence)
    return [*stay, *last]


def _arguments(sequence: ActionSequence) -> set[str]:
    return {name for action in sequence.actions for name in action.args.values()}


def _done_by(step: Step, robots: Mapping[Part, str]) -> Action:
    args = dict(step.action.args)
    for name, part in zip(step.action.skill.robot_parameters, step.parts, strict=True):
        args[name] = robots[part]
    return step.action.skill.ground(args)
