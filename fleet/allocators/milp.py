"""The paper's allocation: a mixed-integer program that keeps the busiest robot's load small."""

from __future__ import annotations

from fleet.allocators.base import AllocationProblem, Allocator, NotAllocated
from keyexpr_schema.plans import Violation

TIME_LIMIT_S = 20.0
"""Wall time given to the solver, s; the best answer so far is taken: every answer is checked."""


class MilpAllocator(Allocator):
    """Minimise the largest number of tasks on a robot (RobotFleet, Gupta et al.), on actors.

    Variables: `x[a, r]` is 1 if robot `r` is actor `a`. Every actor is one robot that is able to
    be it; actors that meet in one task are different robots. Ties go to the least total travel.
    """

    name = "milp"

    def _assign(self, problem: AllocationProblem) -> dict[str, str] | NotAllocated:
        import pulp

        model = pulp.LpProblem("allocation", pulp.LpMinimize)
        chosen = {
            (actor, robot): model.add_variable(f"x_{i}_{j}", cat="Binary")
            for i, (actor, robots) in enumerate(problem.able.items())
            for j, robot in enumerate(robots)
        }
        top = model.add_variable("top", lowBound=0)
        travel_s = {(actor, robot): _approach_s(problem, actor, robot) for actor, robot in chosen}
        scale = 1.0 + sum(travel_s.values())  # the tie-break never outweighs one task
        model += top + pulp.lpSum(travel_s[k] / scale * x for k, x in chosen.items())
        for actor, robots in problem.able.items():
            model += pulp.lpSum(chosen[actor, robot] for robot in robots) == 1
        for robot in problem.world.team:
            mine = [(problem.load[a], x) for (a, r), x in chosen.items() if r == robot]
            if mine:
                model += pulp.lpSum(load * x for load, x in mine) <= top
        for one, other in problem.apart:
            for robot in problem.able[one]:
                if (other, robot) in chosen:
                    model += chosen[one, robot] + chosen[other, robot] <= 1
        # The CBC that lies in PuLP's wheel; `pulp[cbc]` would add 600 MB for the same solver.
        cbc = pulp.PULP_CBC_CMD.pulp_cbc_path
        model.solve(pulp.COIN_CMD(path=cbc, msg=False, timeLimit=TIME_LIMIT_S))
        if model.sol_status not in (
            pulp.LpSolutionOptimal,
            pulp.LpSolutionIntegerFeasible,
        ):
            return NotAllocated(
                (
                    Violation(
                        code="no-allocation",
                        sentence="there are too few robots: actors that meet in one task must be "
                        "different robots, and no choice among those able makes them so",
                    ),
                )
            )
        return {actor: robot for (actor, robot), x in chosen.items() if x.value() > 0.5}


def _approach_s(problem: AllocationProblem, actor: str, robot: str) -> float:
    """Seconds for `robot` to get to where the actor starts to work."""
    for task in problem.plan.tasks:
        action = problem.checked.actions[task.task]
        if task.actor == actor and action.skill.travel_to is not None:
            where = problem.world.value("at", robot)
            return problem.world.travel_s(robot, where, action.args[action.skill.travel_to])
    return 0.0
