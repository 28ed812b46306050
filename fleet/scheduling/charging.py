"""Charging as work of a plan: put in where the sequence of a robot needs it, and refused where
there is no way to charge and the charge is not enough.

A robot charges before a way that it drives anyway, where what it does until its next way would not
leave enough to get to a charger, and there where it is full soonest, by the way and by how long
that charger is taken. Robots that charge at the same charger do so one after the other.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from msgspec.structs import replace

from fleet.core.checker.plan_checker import CheckedPlan
from fleet.core.model.durations import only_moves
from fleet.core.model.endurance import Short, first_short
from fleet.core.model.energy import (
    QUEUEING,
    Charging,
    battery_of,
    chargings,
    energy_wh,
    full_wh,
    left_wh,
    place_after,
    soonest,
    to_charger_wh,
)
from fleet.core.model.skills import Action, SkillModel
from fleet.core.model.world import WorldModel
from fleet.scheduling.plan_schedule import PlanSchedule
from keyexpr_schema.facts import AT, Value
from keyexpr_schema.ids import actor_arg
from keyexpr_schema.payloads.plans import Plan, Task

_NUMBERED = re.compile(r"t([1-9][0-9]{0,14})")


@dataclass(frozen=True)
class ChargingStops:
    """By task, how its robot charges before it; by robot, what its battery is not enough for."""

    before: Mapping[str, Charging]
    short: Mapping[str, Short]


def charging_stops(
    checked: CheckedPlan, allocation: Mapping[str, str], schedule: PlanSchedule
) -> ChargingStops:
    """Where robots have to charge, if they do the plan's tasks in the order of its schedule."""
    before: dict[str, Charging] = {}
    short: dict[str, Short] = {}
    taken = {name: [(0.0, wait_s)] for name, wait_s in checked.world.taken_s.items()}
    for robot, actions in _by_robot(checked, allocation, schedule):
        if (found := first_short(checked.world, robot, actions)) is not None:
            short[robot] = found
            continue
        walk = _Walk(checked.world, robot, schedule.start_s, taken)
        walk.do(actions)
        before |= walk.before
    return ChargingStops(before, short)


def with_charging(
    plan: Plan, schedule: PlanSchedule, stops: ChargingStops, world: WorldModel
) -> Plan:
    """The plan with the tasks by which its robots charge; they belong to the actors that they come
    to charge as, and to the goals that these go on with."""
    task_of = {task.task: task for task in plan.tasks}
    numbers = (match for name in task_of if (match := _NUMBERED.fullmatch(name)) is not None)
    number = max((int(match[1]) for match in numbers), default=0)
    order = sorted(task_of, key=lambda name: (schedule.start_s[name], schedule.end_s[name]))
    last_of: dict[str, str] = {}
    after: dict[str, tuple[str, ...]] = {}
    added: list[Task] = []
    at_charger: dict[str, list[str]] = {}
    for name in order:
        task = task_of[name]
        charging = stops.before.get(name)
        if charging is not None:
            moves = _moving_skill(world, charging.args[charging.skill.actor_parameter])
            if moves is None:
                continue
            actor = actor_arg(task.actor)
            so_far = (last_of[task.actor],) if task.actor in last_of else ()
            to, number = f"t{number + 1}", number + 2
            drive = Task(
                task=to,
                skill=moves.name,
                args={moves.actor_parameter: actor, str(moves.travel_to): charging.place},
                actor=task.actor,
                after=so_far,
                goal=task.goal,
            )
            charge = Task(
                task=f"t{number}",
                skill=charging.skill.name,
                args={**charging.args, charging.skill.actor_parameter: actor},
                actor=task.actor,
                after=(to,),
                goal=task.goal,
            )
            added += [drive, charge]
            after[name] = (charge.task,)
            at_charger.setdefault(charging.charger, []).append(charge.task)
        last_of[task.actor] = name
    locks = {later: one for row in at_charger.values() for one, later in pairwise(row)}
    added = [
        replace(task, after=(*task.after, locks[task.task])) if task.task in locks else task
        for task in added
    ]
    tasks = (
        replace(task, after=(*task.after, *after[task.task])) if task.task in after else task
        for task in plan.tasks
    )
    return replace(plan, tasks=(*tasks, *added))


def _moving_skill(world: WorldModel, robot: str) -> SkillModel | None:
    skills = (world.skills.get(name) for name in world.robots[robot].skills)
    return next((skill for skill in skills if skill is not None and only_moves(skill)), None)


def _by_robot(
    checked: CheckedPlan, allocation: Mapping[str, str], schedule: PlanSchedule
) -> Iterator[tuple[str, list[tuple[str, Action]]]]:
    """The tasks that each robot with a battery does itself, in order."""
    rows: dict[str, list[str]] = {}
    for task in checked.plan.tasks:
        robot = allocation.get(task.actor)
        if robot is not None and battery_of(checked.world, robot) is not None:
            rows.setdefault(robot, []).append(task.task)
    position = {name: at for at, name in enumerate(checked.graph.order)}
    for robot, names in sorted(rows.items()):
        names.sort(key=lambda name: (schedule.start_s[name], position[name]))
        yield robot, [(name, checked.actions[name]) for name in names]


@dataclass
class _Walk:
    """One robot on its way through its tasks, with what is left in its battery."""

    world: WorldModel
    robot: str
    start_s: Mapping[str, float]
    taken: dict[str, list[tuple[float, float]]]
    """By charger, from when to when others are at it [s from now]."""
    before: dict[str, Charging] = field(default_factory=dict)

    def do(self, actions: Sequence[tuple[str, Action]]) -> None:
        """Go through the tasks, and note where to charge."""
        battery = battery_of(self.world, self.robot)
        level = left_wh(self.world, self.robot)
        assert battery is not None and level is not None
        full = full_wh(battery)
        here: Value = self.world.value(AT, self.robot)
        for leg in _legs(actions):
            need, there = self._needs(leg, here)
            charges = any(action.skill.recharges for _, action in leg)
            short = not charges and level - need < self._back(there) and level < full
            start_s = self.start_s[leg[0][0]]
            turn = soonest(self.world, self.robot, here, start_s, self.taken) if short else None
            if turn is not None:
                self.before[leg[0][0]] = charging = turn.charging
                self.taken.setdefault(charging.charger, []).append((turn.begins_s, turn.full_s))
                level, here = full, charging.place
                need, there = self._needs(leg, here)
            # A leg that is too much for one charge is interrupted by another.
            level = full if charges else max(0.0, level - need)
            here = there

    def _needs(self, leg: Sequence[tuple[str, Action]], here: Value) -> tuple[float, Value]:
        need = 0.0
        for _, action in leg:
            need += energy_wh(self.world, action, here, self.robot)
            here = place_after(action, here)
        return need, here

    def _back(self, here: Value) -> float:
        battery = battery_of(self.world, self.robot)
        assert battery is not None
        if not chargings(self.world, self.robot):
            return 0.0
        kept = QUEUEING * battery.reserve_wh
        return to_charger_wh(self.world, self.robot, here) + kept


def _legs(
    actions: Sequence[tuple[str, Action]],
) -> Iterator[Sequence[tuple[str, Action]]]:
    """What a robot does in one place after the other, each with the way there at its beginning."""
    leg: list[tuple[str, Action]] = []
    for name, action in actions:
        if leg and only_moves(action.skill):
            yield leg
            leg = []
        leg.append((name, action))
    if leg:
        yield leg
