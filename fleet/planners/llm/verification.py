"""What a model's plan must pass: the plan checker, and some allocation that can be scheduled."""

from __future__ import annotations

from fleet.core.actors import least_loaded
from fleet.core.checker.plan_checker import (
    CheckedPlan,
    InvalidPlan,
    check_plan,
)
from fleet.core.model.world import WorldModel
from fleet.scheduling.plan_schedule import AllocatedPlan
from keyexpr_schema.payloads.plans import Plan, Violation


def verify(plan: Plan, world: WorldModel) -> CheckedPlan | InvalidPlan:
    """The plan, if the checker passes it and some allocation of it can be scheduled."""
    if foreign := _foreign_goals(plan):
        return InvalidPlan(plan, world, foreign)
    checked = check_plan(plan, world)
    if isinstance(checked, InvalidPlan) or not plan.tasks:
        return checked
    allocation = least_loaded(checked)
    if allocation is None:
        return _invalid(
            checked,
            "too-few-robots",
            "there are fewer able robots than the plan needs at the same time: "
            "let the same actor do more of it",
        )
    allocated = AllocatedPlan(checked, allocation)
    found = next(allocated.schedules(), None)
    if found is None:
        return _invalid(
            checked,
            "deadlock",
            "with the robots there are, some would wait for each other for ever: "
            "let actors that meet do less in between",
        )
    violations = allocated.violations(found)
    return InvalidPlan(plan, world, violations) if violations else checked


def _invalid(checked: CheckedPlan, code: str, sentence: str) -> InvalidPlan:
    return InvalidPlan(checked.plan, checked.world, (Violation(code=code, sentence=sentence),))


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
