"""Programs as one action: what a whole program needs of the facts, of its robot, and makes true.

A program that is a sequence of skill calls needs what its calls need and none before them makes,
and makes true what they make and none behind them changes. What a call needs that is read off
several variables ("reachable") counts only as long as no call before it has changed anything but
the robot.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

from fleet.core.model.derived import DERIVED
from fleet.core.model.formulas.nodes import ConditionalEffect, Formula
from fleet.core.model.parameter_types import PLACE, ROBOT
from fleet.core.model.skills import Action, Need, SkillModel, Skills
from keyexpr_schema.facts import (
    AT,
    HOLDING,
    IN,
    ON,
    FactKey,
    Literal,
    Value,
)
from keyexpr_schema.payloads.programs import DO, Program, ProgramPart

ROBOT_ARGUMENT, TEXT_ARGUMENT = "robot", "text"


def program_action(program: Program, args: Mapping[str, str], skills: Skills) -> Action | None:
    """What a task with this program does, as one action; `None` if a skill of it is not known."""
    model = program_model(program, skills)
    if model is None or set(args) != {ROBOT_ARGUMENT, TEXT_ARGUMENT}:
        return None
    return model.ground({**{name: name for name in model.parameters}, **args})


def skills_called(program: Program, skills: Skills) -> tuple[str, ...]:
    """The skills that its robot must have."""
    if program.steps:
        return tuple(dict.fromkeys(step.skill for step in program.steps))
    called = set(re.findall(r"\b(\w+)\s*\(", program.code))
    return tuple(sorted(called & skills.keys()))


def names_in(program: Program) -> frozenset[str]:
    """Whom and what its calls are about, and what it shall make true."""
    stages = (program.after, *program.stages, *(s for part in program.parts for s in part.stages))
    wanted = {name for rows in stages for row in rows for name in row.subjects}
    return frozenset(wanted.union(*(step.args.values() for step in program.steps)))


def program_model(program: Program, skills: Skills) -> SkillModel | None:
    """The program as a skill of its robot, with every name in it as a parameter that has this name;
    `None` if a skill of it is not known."""
    fold = _Fold()
    for step in program.steps:
        skill = skills.get(step.skill)
        if skill is None or set(skill.parameters) != set(step.args):
            return None
        fold.add(skill, step.args)
    written = dict(fold.written)
    if not program.steps:
        wants = program.stages[-1] if program.stages else ()
        rows = program.after or wants
        # Where it leaves its robot, and with what in the hand, nobody can say.
        written = {FactKey(AT, ROBOT): None, FactKey(HOLDING, ROBOT): None}
        for part in program.parts if not program.after else ():  # what is asked for only if …
            written.update(_open(part))
        certain = (c for c in rows if len(c.subjects) == 1 and c.relation not in DERIVED)
        written.update((FactKey(c.relation, c.subject), c.value) for c in certain)
    names = {key.subject for key in (*written, *(row.variable for row in fold.before))}
    values = (*written.values(), *(row.value for row in fold.before))
    names |= {value for value in values if isinstance(value, str)} - {""}
    names |= {name for step in program.steps for name in step.args.values()}
    parameters = {ROBOT_ARGUMENT: ROBOT, TEXT_ARGUMENT: TEXT_ARGUMENT}
    parameters.update((name, fold.kinds.get(name, "object")) for name in sorted(names - {ROBOT}))
    return SkillModel(
        name=f"{DO}: {program.text}",
        about=program.text,
        parameters=parameters,
        needs={ROBOT_ARGUMENT: tuple(dict.fromkeys(fold.needs))},
        before=tuple(fold.before),
        after=tuple(Literal(key, value) for key, value in written.items()),
        space_in=tuple(fold.space_in),
        duration_s=program.duration_s or fold.duration_s,
        travel_to=None,
        conditions=tuple(fold.conditions),
        conditional=tuple(fold.conditional),
        uses=skills_called(program, skills),
    )


def _open(part: ProgramPart) -> dict[FactKey, Value]:
    """What a part of a program may change, and nobody can say to what."""
    rows = (c for stage in part.stages for c in stage if c.relation not in DERIVED)
    return {
        FactKey(AT if c.relation in (ON, IN) else c.relation, subject): None
        for c in rows
        for subject in c.subjects
    }


class _Fold:
    """What a sequence of skill calls comes to, call by call."""

    def __init__(self) -> None:
        self.before: list[Literal] = []
        self.conditions: list[Formula] = []
        self.conditional: list[ConditionalEffect] = []
        self.written: dict[FactKey, Value] = {}
        self.needs: list[Need] = []
        self.space_in: list[str] = []
        self.kinds: dict[str, str] = {}
        self.duration_s = 0.0
        self._only_moved = True

    def add(self, skill: SkillModel, args: Mapping[str, str]) -> None:
        """One call more."""
        action = skill.ground(args)
        self.before += [row for row in action.before if self._is_needed(row)]
        if self._only_moved:
            self.conditions += action.conditions
        self.conditional += action.conditional
        self._write(action.after)
        self._only_moved &= not action.conditional
        self.needs += [
            Need(need.capability, need.measure, None if need.of is None else args[need.of])
            for need in skill.needs.get(skill.actor_parameter, ())
        ]
        self.space_in += [carrier for carrier in action.space_in if carrier not in self.space_in]
        self.duration_s += skill.duration_s
        for name, kind in skill.types.items():
            self.kinds[args[name]] = PLACE if PLACE in kind.bases else "object"

    def _is_needed(self, row: Literal) -> bool:
        if row in self.before or row.variable in self.written:
            return False
        return self._only_moved or row.variable.relation not in DERIVED

    def _write(self, rows: Iterable[Literal]) -> None:
        for variable, value in rows:
            self.written.pop(variable, None)
            self.written[variable] = value
            self._only_moved &= variable.subject == ROBOT
