"""What a model's plan must pass: the plan checker, and some allocation that can be scheduled."""

from __future__ import annotations

from fleet.core.checker.plan_checker import check_plan
from fleet.core.model.world import WorldModel
from fleet.core.schedule.actor_constraints import least_loaded
from fleet.scheduling.plan_schedule import AllocatedPlan
from keyexpr_schema.payloads.plans import Plan, Violation


def violations_of(plan: Plan, world: WorldModel) -> tuple[Violation, ...]:
    """What the checker says of a plan, or else why no allocation and schedule of it is found."""
    if foreign := _foreign_goals(plan):
        return foreign
    checked = check_plan(plan, world)
    if not checked.valid or not plan.tasks:
        return checked.violations
    allocation = least_loaded(plan, checked, world)
    if allocation is None:
        return (
            Violation(
                code="too-few-robots",
                sentence="there are fewer able robots than the plan needs at the same time: "
                "let the same actor do more of it",
            ),
        )
    allocated = AllocatedPlan(plan, checked, allocation, world)
    found = next(allocated.schedules(), None)
    if found is None:
        return (
            Violation(
                code="deadlock",
                sentence="with the robots there are, some would wait for each other for ever: "
                "let actors that meet do less in between",
            ),
        )
    return allocated.violations(found)


def _foreign_goals(plan: Plan) -> tuple[Violation, ...]:
    return tuple(
        Violation(
            code="unknown-goal",
            sentence=f"{task.task} is for goal {task.goal}; "
            f"goals are {', '.join(plan.goals) or 'none'}",
            task=task.task,
        )
        for task in plan.tasks
        if task.goal not in plan.goals
    )
