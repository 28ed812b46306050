"""Goals that can be reached each by itself and not together: which ones, and whom they contradict.

A cup is to be in the kitchen and in the hallway. Whether two goals go together is found out by
planning for the two; only those about the same subject are tried.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import replace

from fleet.planners.base import NoPlan, Planner, PlanningProblem
from keyexpr_schema.payloads.goals import Goal

SHARE = 0.5
"""Of the time that is left, how much looking for them may take: a plan for the others is made
afterwards."""


def contradictions(
    feasibility: Planner, problem: PlanningProblem, reached: Set[str] = frozenset()
) -> dict[str, str]:
    """By goal, the goal before it that it contradicts.

    Those that are `reached` come first, then the more urgent and the earlier ones. What is not
    found out within the time counts as no contradiction.
    """
    searching = replace(
        problem, budget=problem.budget.part(SHARE), strategy=feasibility.strategies[0]
    )
    kept: dict[str, list[Goal]] = {}
    """By subject."""
    found: dict[str, str] = {}
    by_rank = sorted(problem.goals, key=lambda g: (g.goal not in reached, -g.priority, g.ordinal))
    for goal in by_rank:
        subjects = {subject for each in goal.conditions for subject in each.subjects}
        rivals = {rival.goal: rival for subject in subjects for rival in kept.get(subject, ())}
        for rival in rivals.values():
            if searching.budget.over:
                return found
            both = feasibility.plan(replace(searching, goals=(rival, goal)))
            if isinstance(both, NoPlan) and not both.postponed:
                found[goal.goal] = rival.goal
                break
        else:
            for subject in subjects:
                kept.setdefault(subject, []).append(goal)
    return found


def reasons_of(found: Mapping[str, str], goals: Sequence[Goal]) -> dict[str, str]:
    """By goal that contradicts another, or that another contradicts, a sentence on which."""
    named = {goal.goal: goal for goal in goals}
    reasons = {goal: _reason(named[goal], named[rival]) for goal, rival in found.items()}
    for goal, rival in found.items():
        reasons.setdefault(rival, _reason(named[rival], named[goal]))
    return reasons


def _reason(goal: Goal, other: Goal) -> str:
    wanted = " and ".join(map(str, goal.conditions))
    against = " and ".join(map(str, other.conditions))
    return f"it contradicts goal {other.goal}: {wanted} cannot hold together with {against}"
