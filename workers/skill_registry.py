"""`@skill` makes an async function a skill; `SkillRegistry` is where a worker looks one up."""

from __future__ import annotations

import inspect
import math
from collections.abc import Awaitable, Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any

from keyexpr_schema.errors import InvalidId
from keyexpr_schema.ids import check_id
from keyexpr_schema.plug_ins import load_plug_ins
from workers.errors import BadArguments, BadSkill, UnknownSkill
from workers.skill_context import SkillContext
from workers.world_cache import WorldCache

SKILLS = "robotfleet.skills"
"""Entry-point group: each entry is a `Skill`, or a tuple or list of them."""

ROBOT_ARGUMENT = "robot"
"""The argument of every order that names the robot itself; skills get it as `ctx.robot`."""


class ParameterKind(str, Enum):
    """What an argument of a skill must be."""

    PLACE = "place"
    OBJECT = "object"
    ROBOT = "robot"
    NUMBER = "number"
    TEXT = "text"


SkillFunction = Callable[..., Awaitable[None]]


@dataclass(frozen=True)
class Skill:
    """An action a robot can be ordered to do: its name, its typed parameters, and the doing."""

    name: str
    parameters: Mapping[str, ParameterKind]
    function: SkillFunction
    about: str = ""

    def bind(
        self, args: Mapping[str, str], robot: str, world: WorldCache
    ) -> dict[str, str | float]:
        """The arguments of `function` that an order's `args` mean.

        Raises:
            BadArguments: one is missing, unexpected, or not what its parameter asks for; the
                message names it and what would be right.
        """
        given = dict(args)
        named = given.pop(ROBOT_ARGUMENT, robot)
        if named != robot:
            raise BadArguments(f"{self.name} is ordered for robot {named!r}, but this is {robot}")
        missing = [name for name in self.parameters if name not in given]
        extra = [name for name in given if name not in self.parameters]
        if missing or extra:
            wants = ", ".join(f"{n} (a {k.value})" for n, k in self.parameters.items()) or "nothing"
            wrong = [f"{n} is missing" for n in missing] + [
                f"{n} is not a parameter" for n in extra
            ]
            raise BadArguments(f"{self.name}: {', '.join(wrong)}; it takes {wants}")
        return {
            name: _argument(f"{self.name}: {name}", kind, given[name], world)
            for name, kind in self.parameters.items()
        }

    async def __call__(self, ctx: SkillContext, /, **arguments: Any) -> None:
        """Do it, once.

        Raises:
            SkillFailed: the world did not let it be done.
        """
        await self.function(ctx, **arguments)


def skill(
    name: str, *, parameters: Mapping[str, ParameterKind] | None = None
) -> Callable[[SkillFunction], Skill]:
    """Make `async def f(ctx, <parameters>) -> None` the skill `name`.

    `parameters` says what each argument must be, in order; the first line of the docstring becomes
    `Skill.about`. The function returns when the effects hold and raises `SkillFailed` otherwise.

    Raises:
        BadSkill: the function is not async, or its parameters are not those declared.
    """
    declared = dict(parameters or {})

    def decorate(function: SkillFunction) -> Skill:
        try:
            check_id(name, "skill")
        except InvalidId as error:
            raise BadSkill(str(error)) from None
        if not inspect.iscoroutinefunction(function):
            raise BadSkill(f"skill {name!r}: {function.__name__} must be an `async def`")
        takes = list(inspect.signature(function).parameters)
        if not takes or takes[1:] != list(declared) or ROBOT_ARGUMENT in declared:
            raise BadSkill(
                f"skill {name!r}: {function.__name__} takes ({', '.join(takes)}), but the declared "
                f"parameters want (ctx{''.join(', ' + p for p in declared)}); the robot itself is "
                "`ctx.robot`"
            )
        about = (inspect.getdoc(function) or "").partition("\n")[0]
        return Skill(name=name, parameters=declared, function=function, about=about)

    return decorate


class SkillRegistry:
    """Skills by name."""

    def __init__(self, skills: Iterable[Skill] = ()) -> None:
        """Raises: BadSkill: two skills share a name."""
        self._skills: dict[str, Skill] = {}
        for one in skills:
            if one.name in self._skills:
                raise BadSkill(f"two skills are called {one.name!r}: rename or remove one")
            self._skills[one.name] = one

    def __iter__(self) -> Iterator[Skill]:
        return iter(self._skills.values())

    def get(self, name: str, offered: Iterable[str]) -> Skill:
        """The skill `name` for a robot whose spec offers the skills `offered`.

        Raises:
            UnknownSkill: the worker has no such skill, or the robot does not offer it; the message
                lists those that would do.
        """
        able = tuple(sorted(set(offered) & set(self._skills)))
        if name not in able:
            why = "this robot does not offer" if name in self._skills else "there is no"
            raise UnknownSkill(
                f"{why} skill {name!r}: this robot's worker carries out {', '.join(able) or 'none'}"
            )
        return self._skills[name]

    @classmethod
    def installed(cls, builtin: Iterable[Skill]) -> SkillRegistry:
        """`builtin` skills, and those of installed packages; broken ones are logged and left out.

        Raises:
            BadSkill: two of `builtin` share a name.
        """
        registry = cls(builtin)
        load_plug_ins(SKILLS, registry._add_offered)
        return registry

    def _add_offered(self, offered: Any) -> None:
        """Add the skill or skills that a plug-in offers: all, or none.

        Raises:
            BadSkill: it offers something else, or a skill of a name that is there already.
        """
        skills = tuple(offered) if isinstance(offered, (tuple, list)) else (offered,)
        for one in skills:
            if not isinstance(one, Skill):
                raise BadSkill(f"it offers {one!r}, which is no @skill")
        self._skills = {one.name: one for one in SkillRegistry([*self, *skills])}


def _argument(what: str, kind: ParameterKind, text: str, world: WorldCache) -> str | float:
    if kind is ParameterKind.TEXT:
        return text
    if kind is ParameterKind.NUMBER:
        try:
            number = float(text)
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            raise BadArguments(f"{what} must be a number, not {text!r}")
        return number
    known: dict[ParameterKind, Iterable[str]] = {
        ParameterKind.PLACE: world.places,
        ParameterKind.OBJECT: world.objects,
        ParameterKind.ROBOT: world.specs,
    }
    if text not in known[kind]:
        choices = ", ".join(sorted(known[kind])) or f"none: no {kind.value} is registered"
        raise BadArguments(f"{what} must be a known {kind.value}, not {text!r}; known: {choices}")
    return text
