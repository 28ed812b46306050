"""The allocator `nearest`: each actor goes to the robot that is soonest at its first place."""

from __future__ import annotations

from fleet.allocators import AllocationProblem, Allocator, Assignment
from keyexpr_schema import AT


class NearestAllocator(Allocator):
    """Greedy; the base class checks the answer and finds the order of each robot's actors.

    It knows nothing of actors that must be different robots: for plans without handovers.
    """

    name = "nearest"

    def _assign(self, problem: AllocationProblem) -> Assignment:
        world, busy_s = problem.world, dict.fromkeys(problem.world.team, 0.0)
        chosen: dict[str, str] = {}
        for task in problem.plan.tasks:
            if task.actor in chosen:
                continue
            place = task.args.get("to") or task.args.get("place", "")

            def soonest(robot: str, place: str = place) -> tuple[float, str]:
                return busy_s[robot] + world.travel_s(robot, world.value(AT, robot), place), robot

            robot = min(problem.able[task.actor], key=soonest)
            busy_s[robot], _ = soonest(robot)
            chosen[task.actor] = robot
        return Assignment(chosen)
