"""The form of a plan: names, types and arguments, which can be checked task by task."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from fleet.core.model.skills import Action
from fleet.core.model.world import WorldModel
from keyexpr_schema.ids import actor_arg, actor_in
from keyexpr_schema.payloads.plans import Plan, Task, Violation


class PlanForm:
    """Reads every task as a ground action, or says why it is none.

    With an `allocation`, actors are replaced by their robots.
    """

    def __init__(self, plan: Plan, world: WorldModel, allocation: Mapping[str, str] | None) -> None:
        self.violations: list[Violation] = []
        self.actions: dict[str, Action] = {}
        self._world = world
        self._allocation = allocation
        self._actors = {task.actor for task in plan.tasks}
        for pinned in plan.pins.values():
            if pinned not in world.robots:
                self._say("unknown-name", f"there is no robot {pinned}{_among(world.robots)}", None)
        names = [task.task for task in plan.tasks]
        for name in (
            {name for name in names if names.count(name) > 1}
            if len(set(names)) < len(names)
            else ()
        ):
            self._say("duplicate-task", f"two tasks are called {name}", name)
        known = set(names)
        for task in plan.tasks:
            for before in task.after:
                if before not in known:
                    self._say(
                        "unknown-dependency",
                        f"{task.task} waits for {before}, which is not in the plan",
                        task.task,
                    )
            self._read(task)

    def _say(self, code: str, sentence: str, task: str | None) -> None:
        self.violations.append(Violation(code=code, sentence=sentence, task=task))

    def _read(self, task: Task) -> None:
        skill = self._world.skills.get(task.skill)
        if skill is None:
            self._say(
                "unknown-skill",
                f"{task.task}: there is no skill {task.skill}{_among(self._world.skills)}",
                task.task,
            )
            return
        if set(task.args) != set(skill.parameters):
            self._say(
                "wrong-arguments",
                f"{task.task}: {task.skill} takes {', '.join(skill.parameters)}, "
                f"not {', '.join(task.args) or 'nothing'}",
                task.task,
            )
            return
        if task.args[skill.actor_parameter] != actor_arg(task.actor):
            self._say(
                "wrong-actor",
                f"{task.task}: `{skill.actor_parameter}` must be {actor_arg(task.actor)}, "
                f"the actor that does the task, not {task.args[skill.actor_parameter]}",
                task.task,
            )
            return
        bound: dict[str, str] = {}
        for parameter, kind in skill.parameters.items():
            value = self._bind(task, parameter, kind)
            if value is None:
                return
            bound[parameter] = value
        action = skill.ground(bound)
        if len(set(action.participants)) < len(action.participants):
            self._say(
                "robot-in-two-places",
                f"{task.task}: {task.skill} needs different robots, "
                f"and was given {' and '.join(action.participants)}",
                task.task,
            )
            return
        self.actions[task.task] = action

    def _bind(self, task: Task, parameter: str, kind: str) -> str | None:
        value = task.args[parameter]
        if kind == "robot" and (actor := actor_in(value)) is not None:
            if actor not in self._actors:
                self._say(
                    "unknown-name",
                    f"{task.task}: `{parameter}` names actor {actor}, who has no task"
                    f"{_among(self._actors)}",
                    task.task,
                )
                return None
            if self._allocation is None:
                return value
            robot = self._allocation.get(actor)
            if robot is None or robot not in self._world.robots:
                self._say("unallocated", f"actor {actor} has no robot", task.task)
                return None
            return robot
        found = self._world.kind_of(value)
        if found != kind:
            what = "which nobody knows" if found is None else f"which is a {found}"
            choices = {
                "robot": self._world.robots,
                "object": self._world.objects,
                "place": self._world.places,
            }[kind]
            self._say(
                "unknown-name" if found is None else "wrong-type",
                f"{task.task}: `{parameter}` must be a {kind} and is {value}, {what}"
                f"{_among(choices)}",
                task.task,
            )
            return None
        return value


def _among(names: Iterable[str]) -> str:
    known = sorted(names)
    return f" (there are {', '.join(known)})" if known else " (there are none)"
