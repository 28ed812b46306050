"""The form of a model's answer: one JSON schema to ask with, strict types to read with."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal, TypeVar

import msgspec

from fleet.core.model.skills import SkillModel
from fleet.core.model.world import WorldModel
from fleet.planners.llm.prompt_text import useful_skills
from keyexpr_schema.ids import ACTOR_PREFIX, Id
from keyexpr_schema.payloads.goals import Goal

ACTOR_PATTERN = r"^\?[A-Za-z0-9_-]{1,30}$"
MAX_ENUMERATED = 100
"""Names of one kind that are listed in the schema; with more, any id fits, and the checker says."""
MAX_STARTS = 50
"""Places in an answer where a JSON object is looked for."""

_TaskName = Annotated[str, msgspec.Meta(pattern=r"^t[0-9]{1,3}$")]
_ActorName = Annotated[str, msgspec.Meta(pattern=r"^\?a[0-9]{1,2}$")]
# In the schema names are short: servers turn it into grammars, which grow with every repetition.

T = TypeVar("T")
Actor = Annotated[str, msgspec.Meta(pattern=ACTOR_PATTERN)]


class Answer(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Base of what a model may say: a field that is not asked for is an error."""


class StepAnswer(Answer, frozen=True, kw_only=True):
    """A task of a flat list: a plan's `Task` less its name, order and duration."""

    skill: Id
    args: dict[str, str]
    goal: Id | None = None


class TaskAnswer(StepAnswer, frozen=True, kw_only=True):
    """A task of a graph."""

    task: Id
    after: tuple[Id, ...] = ()


class PinAnswer(Answer, frozen=True):
    """An actor that must be a certain robot."""

    actor: Actor
    robot: Id


class GraphAnswer(Answer, frozen=True):
    """A plan as a graph."""

    tasks: tuple[TaskAnswer, ...]
    pins: tuple[PinAnswer, ...] = ()


class ListAnswer(Answer, frozen=True):
    """A plan as a flat list."""

    tasks: tuple[StepAnswer, ...]
    pins: tuple[PinAnswer, ...] = ()


def plan_schema(
    world: WorldModel, goals: Sequence[Goal], flat: bool, max_tasks: int
) -> dict[str, Any]:
    """The JSON schema of a plan in this world: one variant of a task for each skill.

    It is narrower than the types above, so that a server that holds to it cannot misspell a name.
    """
    goal = _name([goal.goal for goal in goals])
    variants = [
        _task_type(number, skill, world, goal, flat)
        for number, skill in enumerate(useful_skills(world))
        if _possible(skill, world)
    ]
    task: Any = variants[0] if variants else TaskAnswer
    for variant in variants[1:]:
        task = task | variant
    pin: Any = msgspec.defstruct(
        "Pin", [("actor", _ActorName), ("robot", _name(world.team))], forbid_unknown_fields=True
    )
    tasks = Annotated[list[task], msgspec.Meta(max_length=max_tasks)]
    kind = msgspec.defstruct(
        "Plan", [("tasks", tasks), ("pins", list[pin])], forbid_unknown_fields=True
    )
    return schema_of(kind)


def _possible(skill: SkillModel, world: WorldModel) -> bool:
    things: Mapping[str, Any] = {"object": world.objects, "place": world.places, "robot": True}
    return all(things[kind] for kind in skill.parameters.values())


def _task_type(number: int, skill: SkillModel, world: WorldModel, goal: Any, flat: bool) -> Any:
    kinds: dict[str, Any] = {
        "robot": _ActorName,
        "object": _name(world.objects),
        "place": _name(world.places),
    }
    # Parameters are free text to Python: `from` is a good name for one, and no field can have it.
    names = {f"p{n}": parameter for n, parameter in enumerate(skill.parameters)}
    args = msgspec.defstruct(
        f"Args{number}",
        [(field, kinds[skill.parameters[name]]) for field, name in names.items()],
        rename=names,
        forbid_unknown_fields=True,
    )
    fields: list[tuple[str, Any]] = [("args", args), ("goal", goal)]
    if not flat:
        fields = [("task", _TaskName), *fields, ("after", list[_TaskName])]
    return msgspec.defstruct(
        f"Task{number}", fields, tag_field="skill", tag=skill.name, forbid_unknown_fields=True
    )


def _name(known: Any) -> Any:
    names = tuple(known)
    return Literal[names] if 0 < len(names) <= MAX_ENUMERATED else Id


def schema_of(kind: type) -> dict[str, Any]:
    """The JSON schema of a type in the dialect that structured outputs take everywhere.

    No references, no defaults, every field required, no other field allowed.
    """
    schema = msgspec.json.schema(kind)
    return dict(_plain(schema, schema.get("$defs", {})))


def _plain(node: Any, types: Mapping[str, Any]) -> Any:
    if isinstance(node, list):
        return [_plain(item, types) for item in node]
    if not isinstance(node, dict):
        return node
    if "$ref" in node:
        return _plain(types[node["$ref"].removeprefix("#/$defs/")], types)
    plain = {
        key: {name: _plain(value, types) for name, value in inner.items()}
        if key == "properties"
        else _plain(inner, types)
        for key, inner in node.items()
        if key not in ("$defs", "title", "description", "default", "discriminator")
    }
    if all(isinstance(value, str) for value in plain.get("enum", [None])):
        plain["type"] = "string"
    if "properties" in plain:
        plain["required"] = list(plain["properties"])
        plain["additionalProperties"] = False
    return plain


def read_answer(text: str, kind: type[T]) -> T | str:
    """The JSON object in a model's answer as a `kind`, or a sentence that says what is wrong.

    Text around the object (reasoning, code fences) is passed over.
    """
    wrong, read = "the answer is not a JSON object", 0
    decoder = json.JSONDecoder()
    start = text.find("{")
    for _ in range(MAX_STARTS):
        if start < 0:
            break
        try:
            data, end = decoder.raw_decode(text, start)
            return msgspec.convert(data, kind)
        except msgspec.ValidationError as error:
            told = f"the answer does not have the form that was asked for: {error}"
            got = end - start
        except json.JSONDecodeError as error:
            told = f"the answer is not a JSON object: {error}"
            got, end = error.pos - start, start + 1
        except RecursionError:
            return "the answer is nested too deeply"
        except ValueError as error:
            # Python refuses to read integers of absurd length.
            return f"the answer is not a JSON object: {error}"
        # What went furthest was meant as the answer; shorter ones are pieces of it or of prose.
        if got > read:
            wrong, read = told, got
        start = text.find("{", end)
    return wrong


def actor_of(skill: SkillModel | None, args: Mapping[str, str]) -> str:
    """The actor that does a task with these arguments."""
    value = args.get(skill.actor_parameter, "") if skill is not None else ""
    return value.removeprefix(ACTOR_PREFIX) or "a1"
