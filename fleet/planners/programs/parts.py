"""Programs of sentences in parts, some of them under a condition, with searches on the way.

What is asked is asked when the program runs: either way, the rest is planned for what is so then.
What was looked for is known to be found, or not, where the search ends.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from dataclasses import replace as changed

from msgspec.structs import replace

from fleet.core.model.derived import DERIVED, is_located
from fleet.core.model.world import WorldModel
from fleet.planners.base import NoPlan
from fleet.planners.programs.sequences import Lost, Reached, Writing
from fleet.planners.programs.text import asked, branches, either
from keyexpr_schema.facts import AT, IN, LOCATED, ON, FactKey, Value
from keyexpr_schema.payloads.goals import Condition
from keyexpr_schema.payloads.programs import ProgramPart

MOST_LINES = 400
"""A program that would be longer has too many conditions in a row."""


@dataclass(frozen=True)
class Body:
    """Lines of a program, and how long they take at most [s]."""

    lines: list[str] = field(default_factory=list)
    seconds: float = 0.0

    def __add__(self, other: Body) -> Body:
        return Body([*self.lines, *other.lines], self.seconds + other.seconds)


@dataclass(frozen=True)
class Parts:
    """Writes parts, one after the other; of things in `missing` a search has found nothing."""

    writing: Writing
    missing: frozenset[str] = frozenset()

    def body(self, parts: Sequence[ProgramPart], world: WorldModel) -> Body | NoPlan:
        """The lines of all parts, begun in a world, or why there are none."""
        if not parts:
            return Body()
        first, rest = parts[0], parts[1:]
        if first.only_if:
            made = self._under_condition(first, rest, world)
        else:
            found = self.writing.sequence(first.stages, world)
            if isinstance(found, NoPlan):
                return found
            if isinstance(found, Lost):
                return self.looked_for(found, parts, world)
            made = self._reached(found, rest, world)
        return _bounded(made)

    def _reached(
        self, found: Reached, rest: Sequence[ProgramPart], world: WorldModel
    ) -> Body | NoPlan:
        after = self.body(rest, changed(world, facts=found.facts))
        if isinstance(after, NoPlan):
            return after
        lines = self.writing.writer.sequence(found.steps) if found.steps else []
        return Body(lines, found.seconds) + after

    def looked_for(
        self, lost: Lost, parts: Sequence[ProgramPart], world: WorldModel
    ) -> Body | NoPlan:
        """Look for what is lost, and go on from wherever it was found, or as if it is not."""
        cases: dict[tuple[str, ...], list[str]] = {}
        longest = 0.0
        refusal: NoPlan | None = None
        for spot in self.writing.hypotheses(lost, world):
            facts = {**world.facts, FactKey(AT, lost.thing): spot}
            made = self.body(parts, changed(world, facts=facts))
            if isinstance(made, NoPlan):
                refusal = refusal or made
            else:
                cases.setdefault(tuple(made.lines), []).append(spot)
                longest = max(longest, made.seconds)
        if not cases:
            return refusal or NoPlan(f"nobody knows where {lost.thing} is")
        if_nowhere: list[str] | None = None
        if any(lost.thing in row.subjects for part in parts[1:] for row in _found(part)):
            found_nothing = changed(self, missing=self.missing | {lost.thing})
            nowhere = found_nothing.body(parts[1:], world)
            if isinstance(nowhere, NoPlan):
                return nowhere
            longest = max(longest, nowhere.seconds)
            if_nowhere = nowhere.lines
        lines = [
            *self.writing.writer.looking((lost.thing,), lost.rounds),
            *branches(
                lost.thing,
                [(tuple(spots), list(body)) for body, spots in cases.items()],
                if_nowhere,
            ),
        ]
        return _bounded(Body(lines, lost.seconds + longest))

    def _under_condition(
        self, part: ProgramPart, rest: Sequence[ProgramPart], world: WorldModel
    ) -> Body | NoPlan:
        open_rows: list[Condition] = []
        for row in part.only_if:
            if (known := self._settled(row, world)) is None:
                open_rows.append(row)
            elif known is (row.value is row.negated):
                return self.body(_else(rest), world)
        sure = replace(part, only_if=())
        if not open_rows:
            return self.body((sure, *_then(rest)), world)
        tests: list[str] = []
        for row in open_rows:
            if (test := _test(row, world)) is None:
                return NoPlan(f"a program cannot ask whether {row}")
            tests.append(test)
        then: Body | NoPlan = Body(['replan("it is known where it is now")'])
        if not any(row.relation == LOCATED for row in open_rows):
            facts = _facts_if(open_rows, world)
            then = self.body((sure, *_then(rest)), changed(world, facts=facts))
        if isinstance(then, NoPlan):
            return then
        otherwise = self.body(_else(rest), changed(world, facts=_facts_if_not(open_rows, world)))
        if isinstance(otherwise, NoPlan):
            return otherwise
        lines = either(" and ".join(tests), then.lines, otherwise.lines)
        return Body(lines, max(then.seconds, otherwise.seconds))

    def _settled(self, row: Condition, world: WorldModel) -> bool | None:
        """Whether it is found, if that is what is asked, and has been looked for."""
        if row.relation != LOCATED:
            return None
        if any(is_located(name, world.facts.get, world) for name in row.subjects):
            return True
        return False if self.missing.issuperset(row.subjects) else None


def _then(rest: Sequence[ProgramPart]) -> Sequence[ProgramPart]:
    """What comes after a part whose condition holds: not what is done otherwise."""
    return rest[1:] if rest and rest[0].otherwise else rest


def _else(rest: Sequence[ProgramPart]) -> Sequence[ProgramPart]:
    """What comes after a part whose condition does not hold, what is done otherwise first."""
    if not rest or not rest[0].otherwise:
        return rest
    return (replace(rest[0], otherwise=False), *rest[1:])


def _bounded(made: Body | NoPlan) -> Body | NoPlan:
    """What was made, if it is not too long."""
    if isinstance(made, Body) and len(made.lines) > MOST_LINES:
        return NoPlan("it depends on too many things for one program: say it in several")
    return made


def _found(part: ProgramPart) -> list[Condition]:
    return [row for row in part.only_if if row.relation == LOCATED]


def _test(row: Condition, world: WorldModel) -> str | None:
    """The condition as a program asks for it; None where it cannot."""
    if row.negated:
        test = _test(replace(row, negated=False), world)
        return test and f"not ({test})"
    if row.relation == LOCATED:
        tests = [asked(AT, subject, ()) for subject in row.subjects]
        joined = " or ".join(tests)
        return joined if row.value else f"not ({joined})"
    if row.relation in (AT, ON, IN):
        around = [row.value]
        if row.relation == AT:
            carriers = (n for n, thing in world.objects.items() if thing.features)
            around += [n for n in carriers if world.holds(_at(n, row.value))]
        tests = [asked(AT, subject, around) for subject in row.subjects]
    elif row.relation in DERIVED:
        return None
    else:
        tests = [asked(row.relation, subject, (row.value,)) for subject in row.subjects]
    return tests[0] if len(tests) == 1 else f"({' or '.join(tests)})"


def _at(name: str, value: Value) -> Condition:
    return Condition(relation=AT, subject=name, value=value)


def _key(row: Condition) -> FactKey:
    return FactKey(AT if row.relation in (ON, IN) else row.relation, row.subject)


def _facts_if(rows: Sequence[Condition], world: WorldModel) -> Mapping[FactKey, Value]:
    facts = dict(world.facts)
    for row in rows:
        if not world.holds(row) and row.relation != LOCATED:
            facts[_key(row)] = None if row.negated else row.value
    return facts


def _facts_if_not(rows: Sequence[Condition], world: WorldModel) -> Mapping[FactKey, Value]:
    """What is so if not all of it holds: of one truth value, the other one."""
    facts = dict(world.facts)
    for row in rows:
        if world.holds(row) and row.relation != LOCATED:
            only = len(rows) == 1 and isinstance(row.value, bool)
            if row.negated and not rows[1:] and not row.any_of[1:]:
                facts[_key(row)] = row.value
                continue
            facts[_key(row)] = not row.value if only and not row.negated else None
    return facts
