"""Allocation that counts energy: charging is put into the plan where robots need it, and where that
takes time, the work is shared out once more with that time counted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from fleet.allocators.base import Allocated, Allocator, NotAllocated
from fleet.core.checker.plan_checker import CheckedPlan, InvalidPlan, check_plan
from fleet.core.model.energy import battery_of
from fleet.scheduling.allocation_context import AllocationContext
from fleet.scheduling.charging import charging_stops, with_charging
from fleet.scheduling.plan_schedule import AllocatedPlan
from keyexpr_schema.payloads.plans import Violation

MOST_MOVES = 8
"""How often an actor is taken from a robot whose battery is not enough, until that is given up."""


@dataclass(frozen=True)
class ChargedPlan:
    """An allocated plan with the tasks by which its robots charge."""

    checked: CheckedPlan
    allocated: Allocated


def allocate_with_charging(
    allocator: Allocator, checked: CheckedPlan, context: AllocationContext
) -> ChargedPlan | NotAllocated:
    """A checked allocation, as `Allocator.allocate` says, that the batteries last for.

    Work that its robot would have to charge for may be done sooner by another one, and what its
    battery is not enough for goes to others that have more. The violations say what no robot has
    enough for.
    """
    first = _charged(allocator.allocate(checked, context), checked, context)
    for _ in range(MOST_MOVES):
        if not isinstance(first, _TooMuch):
            break
        fewer = first.without_its_robot(checked)
        if fewer is None:
            break
        checked = fewer
        other = _charged(allocator.allocate(checked, context), checked, context)
        if isinstance(other, NotAllocated) and not isinstance(other, _TooMuch):
            break  # where nobody else can, it says what is short
        first = other
    if isinstance(first, NotAllocated) or first.checked is checked:
        return first
    ready_s = {**context.ready_s}
    for robot, takes_s in _charging_s(first).items():
        ready_s[robot] = ready_s.get(robot, 0.0) + takes_s
    counted = allocator.allocate(checked, replace(context, ready_s=ready_s))
    second = _charged(counted, checked, context)
    if isinstance(second, NotAllocated) or _makespan_s(first) <= _makespan_s(second):
        return first
    return second


@dataclass(frozen=True)
class _TooMuch(NotAllocated):
    """That a robot's battery is not enough for what it was to do; it may be for the rest of it."""

    actor: str
    robot: str

    def without_its_robot(self, checked: CheckedPlan) -> CheckedPlan | None:
        """The plan with the task that it ends at for others, where there are any."""
        others = tuple(robot for robot in checked.able[self.actor] if robot != self.robot)
        return replace(checked, able={**checked.able, self.actor: others}) if others else None


def _charged(
    allocated: Allocated | NotAllocated, checked: CheckedPlan, context: AllocationContext
) -> ChargedPlan | NotAllocated:
    if isinstance(allocated, NotAllocated):
        return allocated
    world, allocation = checked.world, allocated.allocation
    as_it_is = ChargedPlan(checked, allocated)
    if all(battery_of(world, robot) is None for robot in allocation.values()):
        return as_it_is
    stops = charging_stops(checked, allocation, allocated.schedule)
    for robot, short in stops.short.items():
        actor = next(task.actor for task in checked.plan.tasks if task.task == short.task)
        violation = Violation(code="no-charge", sentence=short.sentence, task=short.task)
        return _TooMuch((violation,), actor, robot)
    if not stops.before:
        return as_it_is
    plan = with_charging(checked.plan, allocated.schedule, stops, world)
    charged = check_plan(plan, world)
    if isinstance(charged, InvalidPlan):
        return as_it_is  # where a plan has no room for it, robots are sent to charge on the way
    starts_s, begins_s = allocated.schedule.start_s, dict[str, float]()
    for task in checked.plan.tasks:
        start_s = starts_s[task.task]
        begins_s[task.actor] = min(start_s, begins_s.get(task.actor, start_s))
    schedules = AllocatedPlan(charged, allocation, context)
    found = schedules.schedule(sorted(begins_s, key=begins_s.__getitem__))
    if found is None or schedules.violations(found):
        return as_it_is
    who = {allocation[task.actor] for task in plan.tasks if task.task in stops.before}
    notes = (*allocated.notes, f"on the way, {' and '.join(sorted(who))} will charge")
    return ChargedPlan(charged, replace(allocated, schedule=found, notes=notes))


def _charging_s(plan: ChargedPlan) -> Mapping[str, float]:
    """How long robots charge in a plan [s]."""
    found: dict[str, float] = {}
    durations_s = plan.allocated.schedule.durations_s
    for task in plan.checked.plan.tasks:
        if plan.checked.actions[task.task].skill.recharges:
            robot = plan.allocated.allocation[task.actor]
            found[robot] = found.get(robot, 0.0) + durations_s[task.task]
    return found


def _makespan_s(plan: ChargedPlan) -> float:
    return plan.allocated.schedule.makespan_s
