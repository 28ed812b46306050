"""Where a planning job is allocated: its allocation context, and robots whose work goes on."""

from __future__ import annotations

from collections.abc import Mapping, Set

from fleet.core.planning_input import PlanningInput
from fleet.jobshop.time_budget import TimeBudget
from fleet.scheduling.allocation_context import AllocationContext
from keyexpr_schema.ids import actor_in
from keyexpr_schema.payloads.plans import Plan


def context_of(given: PlanningInput, busy: frozenset[str], limit: TimeBudget) -> AllocationContext:
    """What a planning job is allocated in, in seconds from now; actors in `busy` are under way."""
    job = given.job
    robots = {spec.robot for spec in given.robots}
    return AllocationContext(
        ready_s=given.busy_s,
        priority={goal.goal: goal.priority for goal in given.goals if goal.priority},
        due_s={g.goal: g.due_s - given.time_s for g in given.goals if g.due_s is not None},
        previous_allocation={
            actor: robot for actor, robot in job.previous_allocation.items() if robot in robots
        },
        actor_order=job.actor_order,
        under_way=busy | frozenset(job.begun_actors),
        limit=limit,
    )


def robots_under_way(
    given: PlanningInput, plan: Plan, begun_actors: Set[str] = frozenset()
) -> dict[str, str]:
    """The robot of each actor of a new plan whose work it has begun, so that it goes on with it.

    `begun_actors` are bound already; they and what their robots do are left out.
    """
    robots = {spec.robot for spec in given.robots} | {work.robot for work in given.under_way}
    begun: dict[tuple[object, ...], list[str]] = {}
    for done in given.under_way:
        if done.actor not in begun_actors:
            work = _work(done.skill, done.args, robots)
            begun.setdefault(work, []).append(done.robot)
    pins: dict[str, str] = {}
    pinned: set[str] = set()
    for task in plan.tasks:
        if task.actor in begun_actors or task.actor in pins:
            continue
        left = begun.get(_work(task.skill, task.args, frozenset()))
        if left and left[0] not in pinned:
            pins[task.actor] = left.pop(0)
            pinned.add(pins[task.actor])
    return pins


def _work(skill: str, args: Mapping[str, str], robots: Set[str]) -> tuple[object, ...]:
    """What a task is about, whoever does it."""
    return skill, *sorted(
        (name, value)
        for name, value in args.items()
        if value not in robots and actor_in(value) is None
    )
