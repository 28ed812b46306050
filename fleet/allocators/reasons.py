"""Why actors cannot be bound to robots, in sentences that name tasks, capabilities and robots."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence

from fleet.allocators.base import AllocationProblem, NotAllocated
from keyexpr_schema.ids import bare_name
from keyexpr_schema.payloads.plans import Violation

NAMED = 6
"""So many names are listed; the rest are counted."""


def not_apart(problem: AllocationProblem, actors: Collection[str], proven: bool) -> NotAllocated:
    """For actors that would have to be more robots than can be them (or none named)."""
    if actors:
        group = sorted(actors)
        able = sorted({robot for actor in group for robot in problem.able[actor]})
        sentence = (
            f"actors {names(group)} must all be different robots ({_why(problem, group)}), "
            f"and only {names(able)} can be any of them"
        )
    elif proven:
        sentence = (
            "there are too few robots: actors that meet in one task must be different robots, "
            f"and no choice among those able makes them so (actors {names(_tied(problem))})"
        )
    else:
        sentence = (
            "no choice of robots was found in which all actors that must be apart are: "
            f"{names(_tied(problem))}; that is no proof that there is none"
        )
    return NotAllocated((Violation(code="no-allocation", sentence=sentence),))


def names(found: Iterable[str]) -> str:
    """`a`, `a and b`, `a, b and 3 more`."""
    listed = list(found)
    if len(listed) > NAMED:
        return f"{', '.join(listed[:NAMED])} and {len(listed) - NAMED} more"
    return " and ".join(filter(None, [", ".join(listed[:-1]), *listed[-1:]]))


def _tied(problem: AllocationProblem) -> list[str]:
    return sorted({actor for pair in problem.apart for actor in pair})


def _why(problem: AllocationProblem, group: Sequence[str]) -> str:
    """Tasks in which two of the group meet, or what else keeps them apart."""
    inside = set(group)
    meet = [
        task.task
        for task in problem.plan.tasks
        if len(inside & _actors(problem.checked.actions[task.task].participants)) > 1
    ]
    return f"they meet in {names(meet)}" if meet else "each still has a load at the end"


def _actors(participants: Iterable[str]) -> set[str]:
    return {bare_name(name) for name in participants}
