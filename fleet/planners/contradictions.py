"""Goals that can be reached each by itself and not together: which ones, and whom they contradict.

A cup is to be in the kitchen and in the hallway. Whether two goals go together is found out by
planning for the two; only those about the same subject are tried, and about what carries it now.
"""

from __future__ import annotations

from collections.abc import Mapping, Set
from dataclasses import replace

from fleet.core.model.derived import carriers
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
    world = problem.world
    kept: dict[str, list[Goal]] = {}
    """By subject."""
    found: dict[str, str] = {}
    by_rank = sorted(problem.goals, key=lambda g: (g.goal not in reached, -g.priority, g.ordinal))
    for goal in by_rank:
        own = (row for row in (*goal.always, *goal.never) if str(row) not in problem.keepers)
        subjects = {each for row in (*goal.conditions, *own) for each in row.subjects}
        subjects.update(*(carriers(name, world.facts.get, world) for name in tuple(subjects)))
        subjects -= world.places.keys()
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


def reasons_of(found: Mapping[str, str], problem: PlanningProblem) -> dict[str, str]:
    """By goal that contradicts another, or that another contradicts, a sentence on which."""
    wanted = {goal.goal: _wanted(goal, problem) for goal in problem.goals}

    def reason(goal: str, other: str) -> str:
        rows = f"{wanted[goal]} cannot hold together with {wanted[other]}"
        return f"it contradicts goal {other}: {rows}"

    reasons = {goal: reason(goal, rival) for goal, rival in found.items()}
    for goal, rival in found.items():
        reasons.setdefault(rival, reason(rival, goal))
    return reasons


def _wanted(goal: Goal, problem: PlanningProblem) -> str:
    rows = [str(row) for row in goal.conditions]
    for often, kept in (("always", goal.always), ("never", goal.never)):
        rows += [f"{often} {row}" for row in kept if str(row) not in problem.keepers]
    return " and ".join(rows)
