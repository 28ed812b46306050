"""The form of a plan in a model's answer: a JSON schema to ask with, strict types to read with."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any

import msgspec

from fleet.core.model.parameter_types import ROBOT, ParameterType
from fleet.core.model.skills import SkillModel
from fleet.core.model.world import WorldModel
from fleet.llm.structured_output import StructuredAnswer, enumerated, schema_of
from fleet.planners.llm.prompt_text import team_skills
from keyexpr_schema.ids import Id
from keyexpr_schema.payloads.goals import Goal

# In the schema names are short: servers turn it into grammars, which grow with every repetition.
_TaskName = Annotated[str, msgspec.Meta(pattern=r"^t[0-9]{1,3}$")]
_ActorName = Annotated[str, msgspec.Meta(pattern=r"^\?a[0-9]{1,2}$")]
Actor = Annotated[str, msgspec.Meta(pattern=r"^\?[A-Za-z0-9_-]{1,30}$")]


class StepAnswer(StructuredAnswer, frozen=True, kw_only=True):
    """A task of a flat list: a plan's `Task` less its name, order and duration."""

    skill: Id
    args: dict[str, str]
    goal: Id | None = None


class TaskAnswer(StepAnswer, frozen=True, kw_only=True):
    """A task of a graph."""

    task: Id
    after: tuple[Id, ...] = ()


class PinAnswer(StructuredAnswer, frozen=True):
    """An actor that must be a certain robot."""

    actor: Actor
    robot: Id


class GraphAnswer(StructuredAnswer, frozen=True):
    """A plan as a graph."""

    tasks: tuple[TaskAnswer, ...]
    pins: tuple[PinAnswer, ...] = ()


class ListAnswer(StructuredAnswer, frozen=True):
    """A plan as a flat list."""

    tasks: tuple[StepAnswer, ...]
    pins: tuple[PinAnswer, ...] = ()


def plan_schema(
    world: WorldModel, goals: Sequence[Goal], flat: bool, max_tasks: int
) -> dict[str, Any]:
    """The JSON schema of a plan in this world: one variant of a task for each skill.

    It is narrower than the types above, so that a server that holds to it cannot misspell a name.
    """
    goal = enumerated([goal.goal for goal in goals])
    variants = [
        _task_type(number, skill, world, goal, flat)
        for number, skill in enumerate(team_skills(world))
        if _groundable(skill, world)
    ]
    task: Any = variants[0] if variants else TaskAnswer
    for variant in variants[1:]:
        task = task | variant
    pin: Any = msgspec.defstruct(
        "Pin",
        [("actor", _ActorName), ("robot", enumerated(world.team))],
        forbid_unknown_fields=True,
    )
    tasks = Annotated[list[task], msgspec.Meta(max_length=max_tasks)]
    kind = msgspec.defstruct(
        "Plan", [("tasks", tasks), ("pins", list[pin])], forbid_unknown_fields=True
    )
    return schema_of(kind)


def _groundable(skill: SkillModel, world: WorldModel) -> bool:
    return all(map(world.of_type, skill.parameters.values()))


def _argument(kind: ParameterType, world: WorldModel) -> Any:
    return _ActorName if ROBOT in kind.bases else enumerated(world.of_type(kind))


def _task_type(number: int, skill: SkillModel, world: WorldModel, goal: Any, flat: bool) -> Any:
    # Parameters are free text to Python: `from` is a good name for one, and no field can have it.
    names = {f"p{n}": parameter for n, parameter in enumerate(skill.parameters)}
    args = msgspec.defstruct(
        f"Args{number}",
        [(field, _argument(skill.types[name], world)) for field, name in names.items()],
        rename=names,
        forbid_unknown_fields=True,
    )
    fields: list[tuple[str, Any]] = [("args", args), ("goal", goal)]
    if not flat:
        fields = [("task", _TaskName), *fields, ("after", list[_TaskName])]
    return msgspec.defstruct(
        f"Task{number}", fields, tag_field="skill", tag=skill.name, forbid_unknown_fields=True
    )
