"""The planner `rounds`: one short trip for each place, so that many robots can share them."""

from __future__ import annotations

from fleet.planners import NoPlan, Planner, PlanningProblem
from keyexpr_schema import Making, Plan, Task, actor_arg


class RoundsPlanner(Planner):
    """Plans goals of the form `audited(place) = true`; the base class has the plan checked."""

    name = "rounds"
    strategies = ("big-dag",)

    def _solve(self, problem: PlanningProblem) -> Plan | NoPlan:
        tasks: list[Task] = []
        for goal in problem.goals:
            for wanted in goal.conditions:
                if (wanted.relation, wanted.value) != ("audited", True):
                    return NoPlan(f"the planner rounds only has places audited, not {wanted}")
                if problem.world.value("audited", wanted.subject) is not True:
                    tasks += self._trip(problem, goal.goal, wanted.subject, len(tasks))
        return Plan(
            plan=problem.plan,
            revision=problem.revision,
            goals=tuple(goal.goal for goal in problem.goals),
            conditions=tuple(c for goal in problem.goals for c in goal.conditions),
            tasks=tuple(tasks),
            strategy=problem.strategy,
            made_by=self.name,
            allocator=problem.allocator,
            making=Making(planner=self.name),
        )

    def _trip(self, problem: PlanningProblem, goal: str, place: str, before: int) -> list[Task]:
        """Drive there and audit: two tasks of one actor, which any robot that can may become."""
        number = problem.first_task + before
        actor, first, second = f"a{number}", f"t{number}", f"t{number + 1}"
        go = {"robot": actor_arg(actor), "to": place}
        audit = {"robot": actor_arg(actor), "place": place}
        return [
            Task(task=first, skill="navigate", args=go, actor=actor, goal=goal),
            Task(task=second, skill="audit", args=audit, actor=actor, goal=goal, after=(first,)),
        ]
