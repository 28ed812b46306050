"""An allocation problem in numbers, for load balancing, and the numbers back as names."""

from __future__ import annotations

from collections.abc import Sequence

from fleet.allocators.base import AllocationProblem
from fleet.allocators.load_balancing.problem import LoadBalancingProblem
from fleet.allocators.load_balancing.robot_sets import mask_of


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
