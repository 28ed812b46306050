"""A first choice among many sequences, by how much work it is for robots of each kind.

Which sequences are chosen is judged without a schedule: by the work of those roles that only some
robots can take, spread evenly over these, and by what takes long even alone. Both are less than a
plan takes, and cost next to nothing to keep up while one sequence is changed for another.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

from fleet.core.model.skills import Action
from fleet.core.model.world import WorldModel
from fleet.planners.deordering import ActionSequence
from fleet.planners.symbolic.action_sequences import UNLOADING_S
from fleet.planners.symbolic.roles import Part, Roles, steps
from keyexpr_schema.facts import AT, Value

APPROACH_SHARE = 0.5
"""Of the way from anywhere, how far a robot is from where a role begins: a near one takes it."""
MOST_GROUPS = 32
"""Groups of robots whose work is looked at."""
MOST_ROUNDS = 8
"""How often all goals are gone through, at most."""

Choice = Sequence[ActionSequence]


def unloading_s(world: WorldModel) -> float:
    """What a thing that is left in a basket counts for, s: work for a hand, and half of the hands
    are taken to do such work at the same time."""
    hands = sum(world.capability(robot, "grip") is not None for robot in world.team)
    return UNLOADING_S / max(1, hands // 2)


class Estimate(NamedTuple):
    """What a choice comes to; less is better.

    `crowded` is how many loads are left in baskets beyond one for each robot, with those of a plan
    that this one will stand beside, `span_s` the least that a plan takes, with the charge for what
    is left in baskets, `work_s` that of all robots.
    """

    crowded: int
    span_s: float
    work_s: float


@dataclass(frozen=True)
class Workload:
    """What a sequence is for the team: seconds for each group of able robots, the groups of which
    one is left with a load, the number of things so left, and how long it takes at least."""

    busy_s: tuple[tuple[frozenset[str], float], ...]
    loaded: tuple[frozenset[str], ...]
    left: int
    length_s: float


class Workloads:
    """The workloads of sequences in a world; `loads` are those of the `PlanningProblem`."""

    def __init__(
        self, world: WorldModel, roles: Roles, loads: Sequence[frozenset[str]] = ()
    ) -> None:
        self._world, self._roles, self.loads = world, roles, loads
        self.unloading_s = unloading_s(world)
        self._samples: dict[frozenset[str], tuple[str, ...]] = {}
        self._known: dict[int, tuple[ActionSequence, Workload]] = {}

    def of(self, sequence: ActionSequence) -> Workload:
        """The workload of a sequence; kept."""
        if id(sequence) not in self._known:
            self._known[id(sequence)] = sequence, self._workload(sequence)
        return self._known[id(sequence)][1]

    def _workload(self, sequence: ActionSequence) -> Workload:
        roles = {role.who: role for role in self._roles.of(sequence)}
        where: dict[Part, Value] = {}
        free_s = dict.fromkeys(roles, 0.0)
        busy_s = dict.fromkeys(roles, 0.0)
        for step in steps(sequence):
            action, actor = step.action, step.parts[0]
            first = action.skill.travel_to is not None and actor not in where
            took_s = self._mean_s(
                action, where.get(actor), self._kinds(roles[actor].able, actor.robot)
            )
            if first:
                way_s = took_s - self._mean_s(
                    action,
                    action.args[str(action.skill.travel_to)],
                    self._kinds(roles[actor].able, actor.robot),
                )
                took_s -= (1.0 - APPROACH_SHARE) * way_s
            end_s = max(free_s[part] for part in step.parts) + took_s
            for part in step.parts:
                free_s[part] = end_s
                busy_s[part] += took_s
            for (relation, subject), value in action.after:
                if relation == AT and subject == actor.robot:
                    where[actor] = value
        return Workload(
            tuple((role.able, busy_s[who]) for who, role in roles.items()),
            tuple(role.able for role in roles.values() if role.leaves),
            sum(len(role.leaves) for role in roles.values()),
            max(free_s.values(), default=0.0),
        )

    def _kinds(self, able: frozenset[str], otherwise: str) -> tuple[str, ...]:
        """One robot of each kind."""
        if able not in self._samples:
            kinds: dict[object, str] = {}
            for robot in sorted(able):
                model = self._world.robots[robot].model
                kinds.setdefault((model, self._world.capability(robot, "drive")), robot)
            self._samples[able] = tuple(kinds.values())
        return self._samples[able] or (otherwise,)

    def _mean_s(self, action: Action, origin: Value, robots: Sequence[str]) -> float:
        return sum(self._world.duration_s(action, origin, robot) for robot in robots) / len(robots)


class Balance:
    """The work of one choice by group of robots, kept up as sequences are exchanged."""

    def __init__(self, workloads: Workloads, options: Iterable[Choice], choice: Choice) -> None:
        """`options` are all sequences that may be put in."""
        self._workloads = workloads
        able = {
            robots
            for row in options
            for sequence in row
            for robots, _ in workloads.of(sequence).busy_s
        }
        self._groups = _unions(able)
        self._within = {
            robots: [n for n, group in enumerate(self._groups) if robots <= group]
            for robots in able
        }
        self._busy_s = [0.0] * len(self._groups)
        self._loaded = [sum(r <= group for r in workloads.loads) for group in self._groups]
        self._left = 0
        self._work_s = 0.0
        self.choice: list[ActionSequence | None] = list(choice)
        """Of each goal; `None` where another one's sequence serves it, too."""
        self._lengths_s = [workloads.of(sequence).length_s for sequence in choice]
        for sequence in choice:
            self._add(workloads.of(sequence), 1)

    @property
    def chosen(self) -> list[ActionSequence]:
        """The sequences of the choice."""
        return [sequence for sequence in self.choice if sequence is not None]

    @property
    def estimate(self) -> Estimate:
        """What the choice comes to."""
        groups = range(len(self._groups))
        even_s = max((self._busy_s[n] / len(self._groups[n]) for n in groups), default=0.0)
        crowded = sum(max(0, self._loaded[n] - len(self._groups[n])) for n in groups)
        span_s = max(even_s, max(self._lengths_s, default=0.0))
        span_s += self._workloads.unloading_s * self._left
        return Estimate(crowded, round(span_s, 6), round(self._work_s, 6))

    def put(self, number: int, sequence: ActionSequence | None) -> None:
        """Take another sequence in the place of one."""
        if (old := self.choice[number]) is not None:
            self._add(self._workloads.of(old), -1)
        self._lengths_s[number] = 0.0
        if sequence is not None:
            new = self._workloads.of(sequence)
            self._add(new, 1)
            self._lengths_s[number] = new.length_s
        self.choice[number] = sequence

    def estimate_with(self, number: int, sequence: ActionSequence) -> Estimate:
        """What the choice would come to with another sequence in the place of one."""
        old = self.choice[number]
        self.put(number, sequence)
        found = self.estimate
        self.put(number, old)
        return found

    def _add(self, workload: Workload, times: int) -> None:
        for robots, seconds in workload.busy_s:
            self._work_s += times * seconds
            for number in self._within[robots]:
                self._busy_s[number] += times * seconds
        self._left += times * workload.left
        for robots in workload.loaded:
            for number in self._within[robots]:
                self._loaded[number] += times


def balanced(balance: Balance, options: Sequence[Choice]) -> Balance:
    """One sequence exchanged at a time for as long as the work is spread better."""
    best = balance.estimate
    for _ in range(MOST_ROUNDS):
        before = best
        for number, alternatives in enumerate(options):
            for sequence in alternatives:
                if sequence is balance.choice[number]:
                    continue
                old = balance.choice[number]
                balance.put(number, sequence)
                found = balance.estimate
                if found < best:
                    best = found
                else:
                    balance.put(number, old)
        if best == before:
            break
    return balance


def _unions(able: set[frozenset[str]]) -> list[frozenset[str]]:
    """These groups, and those that overlap taken together."""
    found = sorted(
        (group for group in able if group), key=lambda group: (len(group), sorted(group))
    )
    for one, other in combinations(found, 2):
        if len(found) >= MOST_GROUPS:
            break
        if (both := one | other) not in found and one & other:
            found.append(both)
    return found
