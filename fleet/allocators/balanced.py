"""The paper's objective without its limits: the evenest loads, exact at ten thousand tasks."""

from __future__ import annotations

from fleet.allocators.base import AllocationProblem, Allocator, Assignment, NotAllocated
from fleet.allocators.load_balancing import LoadProblem, Unbalanced, balance
from fleet.allocators.load_balancing.bits import mask_of
from fleet.allocators.reasons import not_apart


class BalancedAllocator(Allocator):
    """Least maximum number of tasks on a robot, then least next one, and so on.

    Exact for actors of equal load that need not be apart; else exact for small problems and
    wherever the bound is met. What is not proven is noted, with the bound.
    """

    name = "balanced"

    def _assign(self, problem: AllocationProblem) -> dict[str, str] | Assignment | NotAllocated:
        made = balance(load_problem(problem))
        actors = tuple(problem.able)
        if isinstance(made, Unbalanced):
            return not_apart(problem, [actors[a] for a in made.actors], made.proven)
        team = problem.world.team
        chosen = {actor: team[robot] for actor, robot in zip(actors, made.robot, strict=True)}
        if made.proven:
            return chosen
        note = (
            f"the busiest robot has {max(made.loads)} tasks, and one must have {made.least_top} at "
            "least; that no loads are more even is not proven"
        )
        return Assignment(chosen, notes=(note,))


def load_problem(problem: AllocationProblem) -> LoadProblem:
    """The problem in numbers: actors in the order of `problem.able`, robots in that of the team."""
    team = problem.world.team
    robot_number = {robot: r for r, robot in enumerate(team)}
    actor_number = {actor: a for a, actor in enumerate(problem.able)}
    masks: dict[tuple[str, ...], int] = {}
    for robots in problem.able.values():
        if robots not in masks:
            masks[robots] = mask_of(map(robot_number.__getitem__, robots), len(team))
    return LoadProblem(
        able=[masks[robots] for robots in problem.able.values()],
        load=[problem.load[actor] for actor in problem.able],
        robots=len(team),
        apart=frozenset((actor_number[one], actor_number[other]) for one, other in problem.apart),
    )
