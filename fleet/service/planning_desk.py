"""Carries out planning jobs: planner, allocator and checker in a row, away from keys."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping

from msgspec.structs import replace

from fleet.allocators.base import Allocated, NotAllocated
from fleet.core.events import PlanMade, PlanNotMade
from fleet.core.state import Job, State
from fleet.core.telling import SEARCHED
from fleet.core.world_model import WorldModel
from fleet.planners.base import NoPlan, PlanningProblem
from fleet.service.composition import Composition
from keyexpr_schema.goals import Condition, GoalState, GoalStatus
from keyexpr_schema.ids import ACTOR_PREFIX
from keyexpr_schema.plans import Plan
from keyexpr_schema.tasks import TaskState


def carry_out(
    job: Job, state: State, parts: Composition, at: Mapping[str, float]
) -> PlanMade | PlanNotMade:
    """Plan, check and allocate; how it ended, as an event stamped with `at`.

    `at` has the event's `time_s` and `wall_time_s`.
    """
    started = time.perf_counter()
    made = _plan_and_allocate(job, state, parts)
    took_s = time.perf_counter() - started
    if isinstance(made, NoPlan):
        return PlanNotMade(
            **at,
            job=job.job,
            reason=made.reason,
            violations=made.violations,
            planning_time_s=took_s,
        )
    plan, allocated = made
    schedule = allocated.schedule
    durations_s = {task: end_s - schedule.start_s[task] for task, end_s in schedule.end_s.items()}
    timed = [replace(task, duration_s=durations_s[task.task]) for task in plan.tasks]
    return PlanMade(
        **at,
        job=job.job,
        plan=replace(plan, tasks=tuple(timed)),
        allocation=dict(allocated.allocation),
        sequence=dict(schedule.sequence),
        extra_after=dict(schedule.extra_after),
        durations_s=durations_s,
        makespan_s=schedule.makespan_s,
        lower_bound_s=allocated.lower_bound_s,
        notes=allocated.notes,
        planning_time_s=took_s,
    )


def _plan_and_allocate(
    job: Job, state: State, parts: Composition
) -> tuple[Plan, Allocated] | NoPlan:
    world = state.world(parts.skills)
    allocator = parts.allocators.get(job.allocator)
    if allocator is None:
        choices = ", ".join(sorted(parts.allocators))
        return NoPlan(f"there is no allocator {job.allocator}: choose one of {choices}")
    plan = _plan(job, state, world, parts)
    if isinstance(plan, NoPlan):
        return plan
    kept = replace(plan, pins={**_busy_robots(job, plan, state), **plan.pins})
    made = allocator.allocate(kept, world)
    if isinstance(made, NotAllocated) and kept.pins != plan.pins:
        made = allocator.allocate(plan, world)
    if isinstance(made, NotAllocated):
        return NoPlan(made.violations[0].sentence, made.violations)
    return plan, made


def _wanted(status: GoalStatus, world: WorldModel) -> tuple[Condition, ...]:
    """What a goal still wants: all that it says, or, once reached, that what holds is kept."""
    if status.state is GoalState.REACHED:
        return tuple(condition for condition in status.conditions if world.holds(condition))
    return status.conditions


def _busy_robots(job: Job, plan: Plan, state: State) -> dict[str, str]:
    """Actors of the new plan whose work a robot has begun already, so that it goes on with it."""
    book = state.plans.get(job.plan)
    begun = {
        _work(record.skill, record.args, (record.robot, *state.robots)): record.robot
        for name in job.running
        if book is not None and (record := book.records.get(name)) is not None and record.robot
    }
    pins: dict[str, str] = {}
    for task in plan.tasks:
        robot = begun.get(_work(task.skill, task.args, ()))
        if robot is not None and robot not in pins.values():
            pins[task.actor] = robot
    return pins


def _work(skill: str, args: Mapping[str, str], robots: Iterable[str | None]) -> tuple[object, ...]:
    """What a task is about, whoever does it."""
    others = set(robots)
    return skill, *sorted(
        (name, value)
        for name, value in args.items()
        if value not in others and not value.startswith(ACTOR_PREFIX)
    )


def _plan(job: Job, state: State, world: WorldModel, parts: Composition) -> Plan | NoPlan:
    if job.proposal is not None:
        return _with_goal_conditions(job.proposal, state)
    planner = parts.planners.get(job.planner)
    if planner is None:
        return NoPlan(
            f"there is no planner {job.planner}: choose one of {', '.join(sorted(parts.planners))}"
        )
    goals = tuple(
        replace(state.goals[goal], conditions=_wanted(state.goal_states[goal], world))
        for goal in job.goals
        if goal in state.goals
    )
    return planner.plan(
        PlanningProblem(
            plan=job.plan,
            goals=goals,
            world=world,
            revision=job.revision,
            strategy=job.strategy,
            allocator=job.allocator,
            first_task=job.first_task,
            searched=_searched(job, state, parts),
        )
    )


def _searched(job: Job, state: State, parts: Composition) -> frozenset[str]:
    """Places that a finished task of this plan has searched."""
    book = state.plans.get(job.plan)
    return frozenset(
        literal.variable.subject
        for record in (book.records.values() if book else ())
        if record.state is TaskState.SUCCEEDED and record.skill in parts.skills
        for literal in parts.skills[record.skill].ground(record.args).after
        if literal.variable.relation == SEARCHED
    )


def _with_goal_conditions(plan: Plan, state: State) -> Plan:
    """A proposed plan answers for its goals: their conditions must hold at its end, too."""
    wanted = [
        condition
        for goal in plan.goals
        if goal in state.goal_states
        for condition in state.goal_states[goal].conditions
    ]
    return replace(plan, conditions=tuple(dict.fromkeys([*plan.conditions, *wanted])))
