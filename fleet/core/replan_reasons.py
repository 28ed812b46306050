"""Why a plan is made again: reasons, and wishes of people, which are met or refused one by one."""

from __future__ import annotations

from enum import Enum
from typing import ClassVar

import msgspec

from keyexpr_schema.facts import FactKey
from keyexpr_schema.ids import actor_arg
from keyexpr_schema.payloads.plans import Task
from keyexpr_schema.payloads.programs import Program

_NAMED = 3
"""So many goals are named in a sentence, others counted."""


class ReplanScope(Enum):
    """How much of a plan is made again."""

    REALLOCATE = "reallocate"
    """Nothing speaks against the plan: robots came, went or are late, or a goal was deleted."""
    REPAIR = "repair"
    """Goals that the residual plan no longer serves are planned anew, beside the rest."""
    ANEW = "anew"
    """Everything is planned from the facts."""

    @property
    def strength(self) -> int:
        """The stronger scope takes care of what is a reason for the weaker, too."""
        return _BY_STRENGTH.index(self)


_BY_STRENGTH = (ReplanScope.REALLOCATE, ReplanScope.REPAIR, ReplanScope.ANEW)


class ReplanReason(msgspec.Struct, frozen=True, kw_only=True):
    """Why a plan is made again. `number` tells reasons of one plan apart that read the same.

    `goals`, `tasks`, `robots` and `variables` are what it touches: their tasks wait for the new
    plan, the others are given out meanwhile. None is, where the `whole` plan is in question.
    """

    scope: ReplanScope
    number: int
    sentence: str
    goals: tuple[str, ...] = ()
    tasks: tuple[str, ...] = ()
    robots: tuple[str, ...] = ()
    variables: tuple[FactKey, ...] = ()
    whole: bool = False


class _Wish(msgspec.Struct, frozen=True, kw_only=True, tag_field="wish", tag=True):
    """Base of wishes: the request, if it was one, and a number among the reasons of the plan, which
    `PlanEntry.wishing` gives."""

    number: int = 0
    request: str | None = None


class GoalsAdded(_Wish, frozen=True, kw_only=True):
    """Goals are to go into the plan: they came up, or there was no time for them before."""

    refusal: ClassVar = "the goals were not taken in"

    goals: tuple[str, ...]

    @property
    def reason(self) -> ReplanReason:
        """The wish as a reason to make the plan again."""
        named, more = self.goals[:_NAMED], len(self.goals) - _NAMED
        others = f" and {more} more" if more > 0 else ""
        verb = "are" if self.goals[1:] else "is"
        sentence = f"{', '.join(named)}{others} {verb} still to be planned"
        return ReplanReason(scope=ReplanScope.REPAIR, number=self.number, sentence=sentence)


class TaskAdded(_Wish, frozen=True, kw_only=True):
    """A task is to be done besides, by `robot` if one is named, once those in `after` are done."""

    refusal: ClassVar = "the task was not added"

    skill: str
    args: dict[str, str]
    after: tuple[str, ...] = ()
    robot: str | None = None
    program: Program | None = None

    @property
    def goals(self) -> tuple[str, ...]:
        """None."""
        return ()

    @property
    def reason(self) -> ReplanReason:
        """The wish as a reason to make the plan again."""
        sentence = f"a task ({self.skill}) is added"
        return ReplanReason(scope=ReplanScope.REPAIR, number=self.number, sentence=sentence)

    def task(self, number: int) -> Task:
        """The task as number `number` of its plan, done by an actor of its own."""
        return Task(
            task=f"t{number}",
            skill=self.skill,
            args={"robot": actor_arg(f"x{number}"), **self.args},
            actor=f"x{number}",
            after=self.after,
            program=self.program,
        )


class ReplanAsked(_Wish, frozen=True, kw_only=True):
    """A person wants everything planned again, for these further goals."""

    refusal: ClassVar = "the plan goes on as it was"

    sentence: str
    goals: tuple[str, ...] = ()

    @property
    def reason(self) -> ReplanReason:
        """The wish as a reason to make the plan again."""
        return ReplanReason(
            scope=ReplanScope.ANEW, number=self.number, sentence=self.sentence, whole=True
        )


Wish = GoalsAdded | TaskAdded | ReplanAsked
