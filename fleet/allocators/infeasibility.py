"""Why actors cannot be bound to robots, in sentences that name tasks and robots."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from fleet.allocators.base import AllocationProblem, NotAllocated
from fleet.allocators.load_balancing.problem import NoAssignment
from keyexpr_schema.ids import bare_name
from keyexpr_schema.payloads.plans import Violation

NAMED = 6
"""So many names are listed; the rest are counted."""


def explanation(problem: AllocationProblem, found: NoAssignment) -> NotAllocated:
    """What load balancing came to, for people."""
    names = tuple(problem.able)
    clique = sorted(names[actor] for actor in found.clique)
    conflicting = _listed(sorted({actor for pair in problem.apart for actor in pair}))
    if clique:
        able = sorted({robot for actor in clique for robot in problem.able[actor]})
        sentence = (
            f"actors {_listed(clique)} must all be different robots ({_why(problem, clique)}), "
            f"and only {_listed(able)} can be any of them"
        )
    elif found.proven:
        sentence = (
            "there are too few robots: actors that meet in one task must be different robots, "
            f"and no choice among those able makes them so (actors {conflicting})"
        )
    else:
        sentence = (
            "no choice of robots was found in which all actors that must be apart are: "
            f"{conflicting}; that is no proof that there is none"
        )
    return NotAllocated((Violation(code="no-allocation", sentence=sentence),))


def _listed(names: Sequence[str]) -> str:
    """`a`, `a and b`, `a, b and 3 more`."""
    if len(names) > NAMED:
        return f"{', '.join(names[:NAMED])} and {len(names) - NAMED} more"
    return " and ".join(filter(None, [", ".join(names[:-1]), *names[-1:]]))


def _why(problem: AllocationProblem, clique: Sequence[str]) -> str:
    """Tasks in which two of the clique meet, or what else keeps them apart."""
    inside = set(clique)
    meet = [
        task.task
        for task in problem.plan.tasks
        if len(inside & _actors(problem.checked.actions[task.task].participants)) > 1
    ]
    return f"they meet in {_listed(meet)}" if meet else "each still has a load at the end"


def _actors(participants: Iterable[str]) -> set[str]:
    return {bare_name(name) for name in participants}
