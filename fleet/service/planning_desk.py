"""Carries out planning jobs: planner, allocator and checker in a row, away from keys."""

from __future__ import annotations

import time

from msgspec.structs import replace

from fleet.allocators.base import Allocator, NotAllocated
from fleet.core.events import PlanMade, PlanNotMade
from fleet.core.state import Job, State
from fleet.core.world_model import WorldModel
from fleet.planners.base import NoPlan, PlanningProblem
from fleet.service.composition import Composition
from keyexpr_schema.plans import Plan


def carry_out(
    job: Job, state: State, parts: Composition, time_s: float, wall_time_s: float
) -> PlanMade | PlanNotMade:
    """Plan, check and allocate; how it ended, as an event stamped with the given times."""
    started = time.perf_counter()
    world = state.world(parts.skills)
    allocator = parts.allocators.get(job.allocator)
    plan = _plan(job, state, world, parts) if allocator is not None else _no_allocator(job, parts)
    if isinstance(plan, NoPlan) or allocator is None:
        assert isinstance(plan, NoPlan)
        return PlanNotMade(
            time_s=time_s,
            wall_time_s=wall_time_s,
            job=job.job,
            reason=plan.reason,
            violations=plan.violations,
            planning_time_s=time.perf_counter() - started,
        )
    return _allocate(job, plan, allocator, world, time_s, wall_time_s, started)


def _allocate(
    job: Job,
    plan: Plan,
    allocator: Allocator,
    world: WorldModel,
    time_s: float,
    wall_time_s: float,
    started: float,
) -> PlanMade | PlanNotMade:
    made = allocator.allocate(plan, world)
    if isinstance(made, NotAllocated):
        return PlanNotMade(
            time_s=time_s,
            wall_time_s=wall_time_s,
            job=job.job,
            reason=made.violations[0].sentence,
            violations=made.violations,
            planning_time_s=time.perf_counter() - started,
        )
    schedule = made.schedule
    return PlanMade(
        time_s=time_s,
        wall_time_s=wall_time_s,
        job=job.job,
        plan=plan,
        allocation=dict(made.allocation),
        sequence=dict(schedule.sequence),
        extra_after=dict(schedule.extra_after),
        durations_s={
            task: end_s - schedule.start_s[task] for task, end_s in schedule.end_s.items()
        },
        makespan_s=schedule.makespan_s,
        planning_time_s=time.perf_counter() - started,
    )


def _no_allocator(job: Job, parts: Composition) -> NoPlan:
    choices = ", ".join(sorted(parts.allocators))
    return NoPlan(f"there is no allocator {job.allocator}: choose one of {choices}")


def _plan(job: Job, state: State, world: WorldModel, parts: Composition) -> Plan | NoPlan:
    if job.proposal is not None:
        return _with_goal_conditions(job.proposal, state)
    planner = parts.planners.get(job.planner)
    if planner is None:
        return NoPlan(
            f"there is no planner {job.planner}: choose one of {', '.join(sorted(parts.planners))}"
        )
    goals = tuple(
        replace(state.goals[goal], conditions=state.goal_states[goal].conditions)
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
        )
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
