"""An allocation problem in numbers, for load balancing; and its answers back in names: robots, or
why actors cannot be bound to any.
"""

from __future__ import annotations

from collections.abc import Sequence

from fleet.allocators.base import AllocationProblem, NotAllocated
from fleet.allocators.load_balancing.problem import LoadBalancingProblem, NoAssignment
from fleet.allocators.load_balancing.robot_sets import mask_of
from keyexpr_schema.ids import bare_name
from keyexpr_schema.payloads.plans import Violation

NAMED = 6
"""So many names are listed in a sentence; the rest are counted."""


def balancing_problem(problem: AllocationProblem) -> LoadBalancingProblem:
    """Actors are numbered in the order of `problem.able`, robots in that of the team."""
    team = problem.world.team
    robot_number = {robot: r for r, robot in enumerate(team)}
    actor_number = {actor: a for a, actor in enumerate(problem.able)}
    masks = {
        robots: mask_of(map(robot_number.__getitem__, robots), len(team))
        for robots in set(problem.able.values())
    }
    return LoadBalancingProblem(
        able=[masks[robots] for robots in problem.able.values()],
        load=[problem.load[actor] for actor in problem.able],
        robots=len(team),
        apart=frozenset((actor_number[one], actor_number[other]) for one, other in problem.apart),
    )


def named(problem: AllocationProblem, robots: Sequence[int]) -> dict[str, str]:
    """By actor, the name of the robot with the actor's number."""
    team = problem.world.team
    return {actor: team[robot] for actor, robot in zip(problem.able, robots, strict=True)}


def explanation(problem: AllocationProblem, found: NoAssignment) -> NotAllocated:
    """Why load balancing found no assignment, in a sentence that names actors and robots."""
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
        task
        for task, action in problem.checked.actions.items()
        if len(inside & {bare_name(name) for name in action.participants}) > 1
    ]
    return f"they meet in {_listed(meet)}" if meet else "each still has a load at the end"
