"""The form of a plan: names, types and arguments, which can be checked task by task."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping

from msgspec.structs import replace

from fleet.core.model.parameter_types import (
    BASE_TYPES,
    ROBOT,
    ParameterType,
    parse_type,
    with_article,
)
from fleet.core.model.programs import ROBOT_ARGUMENT, TEXT_ARGUMENT, program_action
from fleet.core.model.skills import Action
from fleet.core.model.world import WorldModel
from keyexpr_schema.ids import actor_arg, actor_in
from keyexpr_schema.payloads.plans import Plan, Task, Violation
from keyexpr_schema.payloads.programs import DO, Program


class _Malformed(Exception):
    """What is wrong with a task: a code and a sentence."""


class PlanForm:
    """Reads every task as a ground action, or says why it is none.

    With an `allocation`, actors are replaced by their robots.
    """

    def __init__(self, plan: Plan, world: WorldModel, allocation: Mapping[str, str] | None) -> None:
        self.violations: list[Violation] = []
        self.actions: dict[str, Action] = {}
        self._world, self._allocation = world, allocation
        self._actors = {task.actor for task in plan.tasks}
        for pinned in plan.pins.values():
            if pinned not in world.robots:
                self._report("unknown-name", f"there is no robot {pinned}{_among(world.robots)}")
        times = Counter(task.task for task in plan.tasks)
        for name, count in times.items():
            if count > 1:
                self._report("duplicate-task", f"two tasks are called {name}", name)
        for task in plan.tasks:
            for before in task.after:
                if before not in times:
                    sentence = f"{task.task} waits for {before}, which is not in the plan"
                    self._report("unknown-dependency", sentence, task.task)
            try:
                self.actions[task.task] = self._action(task)
            except _Malformed as wrong:
                code, sentence = wrong.args
                self._report(code, f"{task.task}: {sentence}", task.task)

    def _report(self, code: str, sentence: str, task: str | None = None) -> None:
        self.violations.append(Violation(code=code, sentence=sentence, task=task))

    def _program(self, task: Task, program: Program) -> Action:
        """A task with a program: each call of it is checked like a task."""
        if task.skill != DO or set(task.args) != {ROBOT_ARGUMENT, TEXT_ARGUMENT}:
            raise _Malformed(
                "wrong-arguments",
                f"a task with a program is called {DO} and takes {ROBOT_ARGUMENT} and "
                f"{TEXT_ARGUMENT}, not {task.skill} with {', '.join(task.args) or 'nothing'}",
            )
        if not program.code:
            raise _Malformed("no-program", f"nobody has written a program for {program.text!r}")
        for step in program.steps:
            own = {n: task.args[ROBOT] if v == ROBOT else v for n, v in step.args.items()}
            self._action(replace(task, skill=step.skill, args=own, program=None))
        robot = self._bound(task, ROBOT_ARGUMENT, parse_type(ROBOT))
        action = program_action(program, {**task.args, ROBOT_ARGUMENT: robot}, self._world.skills)
        if action is None:
            raise _Malformed("unknown-skill", "its program calls a skill that nobody knows")
        return action

    def _action(self, task: Task) -> Action:
        if task.program is not None:
            return self._program(task, task.program)
        skill = self._world.skills.get(task.skill)
        if skill is None:
            raise _Malformed(
                "unknown-skill", f"there is no skill {task.skill}{_among(self._world.skills)}"
            )
        if task.args.keys() != skill.parameters.keys():
            raise _Malformed(
                "wrong-arguments",
                f"{task.skill} takes {', '.join(skill.parameters)}, "
                f"not {', '.join(task.args) or 'nothing'}",
            )
        parameter = skill.actor_parameter
        if task.args[parameter] != actor_arg(task.actor):
            raise _Malformed(
                "wrong-actor",
                f"`{parameter}` must be {actor_arg(task.actor)}, "
                f"the actor that does the task, not {task.args[parameter]}",
            )
        types = skill.types.items()
        action = skill.ground({name: self._bound(task, name, kind) for name, kind in types})
        if len(set(action.participants)) < len(action.participants):
            raise _Malformed(
                "robot-in-two-places",
                f"{task.skill} needs different robots, "
                f"and was given {' and '.join(action.participants)}",
            )
        return action

    def _bound(self, task: Task, parameter: str, kind: ParameterType) -> str:
        value = task.args[parameter]
        if ROBOT in kind.bases and (actor := actor_in(value)) is not None:
            if actor not in self._actors:
                raise _Malformed(
                    "unknown-name",
                    f"`{parameter}` names actor {actor}, who has no task{_among(self._actors)}",
                )
            if self._allocation is None:
                return value
            robot = self._allocation.get(actor)
            if robot is None or robot not in self._world.robots:
                raise _Malformed("unallocated", f"actor {actor} has no robot")
            return robot
        if not self._world.is_of_type(value, kind):
            found = self._world.kind_of(value)
            what = "which nobody knows"
            if found is not None:
                what = (
                    f"which is {with_article(found)}" if found not in kind.bases else "which is not"
                )
            wanted = with_article(str(kind)) if str(kind) in BASE_TYPES else str(kind)
            raise _Malformed(
                "unknown-name" if found is None else "wrong-type",
                f"`{parameter}` must be {wanted} and is {value}, {what}"
                f"{_among(self._world.of_type(kind))}",
            )
        return value


def _among(names: Iterable[str]) -> str:
    known = sorted(names)
    return f" (there are {', '.join(known)})" if known else " (there are none)"
