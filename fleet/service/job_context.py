"""Where a planning job is allocated: its allocation context, and robots whose work goes on."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Set

from fleet.core.dispatch.delays import behind_s
from fleet.core.plan_entry import PlanningJob
from fleet.core.state import State
from fleet.scheduling.allocation_context import AllocationContext
from keyexpr_schema.ids import actor_in
from keyexpr_schema.payloads.plans import Plan


def context_of(job: PlanningJob, state: State, busy: frozenset[str]) -> AllocationContext:
    """What a planning job is allocated in, in seconds from now; actors in `busy` are under way."""
    goals = [state.goals[goal] for goal in job.goals if goal in state.goals]
    return AllocationContext(
        ready_s={
            robot: wait_s for robot in state.robots if (wait_s := _busy_s(job, state, robot)) > 0.0
        },
        priority={goal.goal: goal.priority for goal in goals if goal.priority},
        due_s={goal.goal: goal.due_s - state.time_s for goal in goals if goal.due_s is not None},
        previous_allocation={
            actor: robot
            for actor, robot in job.previous_allocation.items()
            if robot in state.robots
        },
        actor_order=job.actor_order,
        under_way=busy | frozenset(job.begun_actors),
    )


def _busy_s(job: PlanningJob, state: State, robot: str) -> float:
    """How long the robot is taken, s; work of the job's own plan is in the new plan once more."""
    late_s = behind_s(state, robot)
    for plan, entry in state.plans.items():
        for record in entry.outstanding():
            if record.robot == robot and plan != job.plan:
                begun_s = state.time_s if record.started_s is None else record.started_s
                return late_s + max(0.0, begun_s + record.duration_s - state.time_s)
    return late_s


def robots_under_way(
    job: PlanningJob, plan: Plan, state: State, begun_actors: Set[str] = frozenset()
) -> dict[str, str]:
    """The robot of each actor of a new plan whose work it has begun, so that it goes on with it.

    `begun_actors` are bound already; they and what their robots do are left out.
    """
    entry = state.plans.get(job.plan)
    begun: dict[tuple[object, ...], list[str]] = {}
    for name in job.under_way:
        record = entry.records.get(name) if entry is not None else None
        if record is not None and record.robot and record.actor not in begun_actors:
            work = _work(record.skill, record.args, (record.robot, *state.robots))
            begun.setdefault(work, []).append(record.robot)
    pins: dict[str, str] = {}
    for task in plan.tasks:
        if task.actor in begun_actors:
            continue
        robots = begun.get(_work(task.skill, task.args, ()))
        if robots and task.actor not in pins and robots[0] not in pins.values():
            pins[task.actor] = robots.pop(0)
    return pins


def _work(skill: str, args: Mapping[str, str], robots: Iterable[str | None]) -> tuple[object, ...]:
    """What a task is about, whoever does it."""
    others = set(robots)
    return skill, *sorted(
        (name, value)
        for name, value in args.items()
        if value not in others and actor_in(value) is None
    )
