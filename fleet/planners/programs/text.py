"""The text of programs: sequences of skill calls, with checks, loops over things, and second tries.

What a program may call, and in which Python, `docs/programs.md` says.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from fleet.core.model.parameter_types import ROBOT
from fleet.core.model.skills import SkillModel, Skills
from keyexpr_schema.facts import AT, HOLDING, SEARCHED, FactKey, Literal, Value
from keyexpr_schema.payloads.programs import ProgramStep

INDENT = "    "
Steps = tuple[ProgramStep, ...]


@dataclass(frozen=True)
class Writer:
    """Writes for a robot that has `able`, of the `skills` that are known."""

    skills: Skills
    able: tuple[str, ...]

    def sequence(self, steps: Steps) -> list[str]:
        """The lines of a sequence; what repeats itself with other names is a loop."""
        return self._each(_rounds(steps), "")

    def looking(self, things: Sequence[str], rounds: Sequence[Steps]) -> list[str]:
        """The lines of looking for things, round by round, until it is known where all are."""
        lacking = " or ".join(f"ask({_q(AT)}, {_q(thing)}) is None" for thing in things)
        lines: list[str] = []
        for same in _alike(rounds):
            lines += self._each(same, f"if {lacking}:")
        return lines

    def _each(self, rounds: Sequence[Steps], guard: str) -> list[str]:
        """One round after the other, each only if the guard holds."""
        names, rows = _varying(rounds)
        inner = [line for step in names for line in self._step(step)]
        if guard:
            inner = [guard, *_indented(inner)]
        if len(rounds) == 1:
            return inner
        count = len(rows[0])
        if count == 0:
            return [f"for _ in range({len(rounds)}):", *_indented(inner)]
        head = ", ".join(f"name_{n + 1}" for n in range(count))
        values = ", ".join(
            _q(row[0]) if count == 1 else f"({', '.join(map(_q, row))})" for row in rows
        )
        return [f"for {head} in ({values}):", *_indented(inner)]

    def _step(self, step: _Named) -> Iterator[str]:
        """One call; what takes something looks again first where that does not succeed."""
        skill = self.skills[step.skill]
        thing, place = self._taken(skill)
        call = _call(step.skill, step.args, skill)
        if thing is None:
            yield call
            return
        name = step.args[thing]
        yield f"if ask({_q(AT)}, {name}) is None:"
        yield f"{INDENT}replan({_told('nobody knows where', name, 'is now')})"
        looker = self._looker()
        if looker is None or place is None:
            yield call
            return
        where = next(iter(n for n, kind in looker.parameters.items() if kind != ROBOT))
        yield "try:"
        yield INDENT + call
        yield "except RuntimeError:"
        yield INDENT + _call(looker.name, {where: step.args[place]}, looker)
        yield INDENT + call

    def _taken(self, skill: SkillModel) -> tuple[str | None, str | None]:
        """The parameter of the thing that a skill takes into the hand, and of the place where."""
        robot = skill.actor_parameter
        for (relation, subject), value in skill.after:
            if (relation, subject) == (HOLDING, robot) and value in skill.parameters:
                places = (n for n, kind in skill.parameters.items() if kind == "place")
                return str(value), next(places, None)
        return None, None

    def _looker(self) -> SkillModel | None:
        """The skill by which the robot looks around in a place."""
        for name in self.able:
            skill = self.skills.get(name)
            if skill is None or len(skill.parameters) != 2:
                continue
            places = [n for n, kind in skill.parameters.items() if kind == "place"]
            if places and Literal(FactKey(SEARCHED, places[0]), True) in skill.after:
                return skill
        return None


@dataclass(frozen=True)
class _Named:
    """A call whose arguments are written as the text has them: quoted, or names of a loop."""

    skill: str
    args: dict[str, str]


def written(title: str, lines: Iterable[str]) -> str:
    """A program's text, under its sentence as a comment."""
    return "\n".join([f"# {' '.join(title.split())}", *lines, ""])


def branches(
    thing: str,
    cases: Sequence[tuple[tuple[str, ...], list[str]]],
    nowhere: Sequence[str] | None = None,
) -> list[str]:
    """Lines for each of the places where a thing may have been found, and for nowhere: that it
    cannot be done, if nothing else."""
    lines = [f"found = ask({_q(AT)}, {_q(thing)})", "if found is None:"]
    lost = [f"fail({_q(f'{thing} is not to be found')})"]
    lines += _indented(lost if nowhere is None else nowhere or ["pass"])
    for places, body in cases:
        lines.append(f"elif found in ({', '.join(map(_q, places))},):")
        lines += _indented(body or ["pass"])
    lines.append("else:")
    lines.append(f"{INDENT}replan(f{_q(f'{thing} is at {{found}}')})")
    return lines


def either(test: str, then: Sequence[str], otherwise: Sequence[str]) -> list[str]:
    """Lines for what is done if something holds, and if not."""
    lines = [f"if {test}:", *_indented(then or ["pass"])]
    return [*lines, "else:", *_indented(otherwise)] if otherwise else lines


def asked(relation: str, subject: str, values: Sequence[Value]) -> str:
    """Whether one of these values is known of a variable; without any, whether anything is."""
    found = f"ask({_q(relation)}, {_q(subject)})"
    if not values:
        return f"{found} is not None"
    shown = [_q(value) if isinstance(value, str) else repr(value) for value in values]
    return f"{found} == {shown[0]}" if len(shown) == 1 else f"{found} in ({', '.join(shown)})"


def _rounds(steps: Steps) -> list[Steps]:
    """The sequence as the most rounds of the same skills in which every name stands for one."""
    for size in range(1, len(steps) // 2 + 1):
        if len(steps) % size:
            continue
        rounds = [steps[i : i + size] for i in range(0, len(steps), size)]
        if all(_shape(one) == _shape(rounds[0]) for one in rounds):
            return rounds
    return [steps]


def _alike(rounds: Sequence[Steps]) -> Iterator[list[Steps]]:
    """Neighbours of the same shape together."""
    same: list[Steps] = []
    for one in rounds:
        if same and _shape(one) != _shape(same[0]):
            yield same
            same = []
        same.append(one)
    if same:
        yield same


def _shape(steps: Steps) -> tuple[object, ...]:
    return tuple((step.skill, tuple(step.args)) for step in steps)


def _varying(rounds: Sequence[Steps]) -> tuple[list[_Named], list[tuple[str, ...]]]:
    """The calls of one round with names for what is not the same in all, and those by round. What
    is always the same as something else has one name with it."""
    columns: dict[tuple[str, ...], str] = {}
    calls = []
    for number, step in enumerate(rounds[0]):
        args = {}
        for name, value in step.args.items():
            if value == ROBOT:
                continue
            column = tuple(one[number].args[name] for one in rounds)
            if len(set(column)) == 1:
                args[name] = _q(value)
            else:
                args[name] = columns.setdefault(column, f"name_{len(columns) + 1}")
        calls.append(_Named(step.skill, args))
    rows = [tuple(column[i] for column in columns) for i in range(len(rounds))]
    return calls, rows


def _call(skill: str, args: dict[str, str], model: SkillModel) -> str:
    given = (f"{name}={args[name]}" for name in model.parameters if name in args)
    return f"{skill}({', '.join(given)})"


def _told(before: str, name: str, after: str) -> str:
    if name.startswith('"'):
        return _q(f"{before} {json.loads(name)} {after}")
    return f"f{_q(f'{before} {{{name}}} {after}')}"


def _q(text: str) -> str:
    return json.dumps(text)


def _indented(lines: Iterable[str]) -> list[str]:
    return [INDENT + line for line in lines]
