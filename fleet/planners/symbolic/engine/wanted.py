"""What is wanted of a task's variables, so that conditions come to hold.

Where a thing is wanted to be can be reached by bringing it, or what carries it. Of many
alternatives those are looked at that are wanted anyway, or as many as it takes.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from enum import IntEnum
from functools import cache

from fleet.core.model import derived
from fleet.core.model.formulas.evaluation import conjuncts, evaluate, negation
from fleet.core.model.formulas.nodes import (
    And,
    Compare,
    Constant,
    Formula,
    Holds,
    Not,
    Stored,
    Sum,
    Term,
    Total,
    Variable,
)
from fleet.core.model.parameter_types import ROBOT
from fleet.core.model.world import WorldModel, room_left
from fleet.planners.symbolic.engine.alternatives import Quorum, directions, quorums
from fleet.planners.symbolic.engine.instantiation import Facts, Instantiation
from fleet.planners.symbolic.engine.readings import ValueOf, is_read_off
from fleet.planners.symbolic.engine.relevance import ANY
from keyexpr_schema.facts import (
    AT,
    HELD,
    HOLDING,
    IN,
    LOCATED,
    NOTHING,
    ON,
    FactKey,
    Literal,
    Value,
)

FEW = 4
"""Alternatives that are all looked at; of more, only as many as it takes."""


class Breadth(IntEnum):
    """How far it is looked for what can help.

    NARROW: of many alternatives only some. WIDE: all of them. THOROUGH: in all places, and also
    with detours over furniture, trays and baskets that nothing speaks of.
    """

    NARROW = 0
    WIDE = 1
    THOROUGH = 2


class Wanted:
    """Literals that are wanted of the variables that are stored, one after the other.

    Things are put down and handed over in `places`. `chosen` are those alternatives that are looked
    at where there are many; of others all that nothing else wants, too, are looked at and noted as
    `undecided`. `values_of` are those that a variable may have, by what is known so far.
    """

    def __init__(
        self,
        skills: Instantiation,
        places: Sequence[str],
        breadth: Breadth,
        chosen: Mapping[Quorum, Collection[Formula]],
        values_of: Callable[[FactKey], Collection[Value]],
        now: ValueOf,
    ) -> None:
        self.world: WorldModel = skills.world
        self.start: Facts = skills.start
        self.robots = skills.robots
        self.free = skills.free
        self.skills = skills
        self.around = cache(self._carried_by)
        self._places = places
        self._breadth = breadth
        self._thorough = breadth is Breadth.THOROUGH
        self._chosen = chosen
        self._values = values_of
        self._now = now
        self._inside = cache(self._with_parts)
        self._carriers = self._that_carry() if self._thorough else []
        self._along: set[Literal] = set()
        self._looked_into: set[str] = set()
        self._wanted: set[Literal] = set()
        self._open: list[Literal] = []
        self._put_off: dict[Quorum, None] = {}
        self.leaves_out = False
        """Whether alternatives were left out."""
        self.undecided: dict[Quorum, Quorum] = {}
        """By alternatives of which none were `chosen`: what of them is missing still."""

    def next(self) -> Literal | None:
        """The next literal that is wanted; `None` if there is none any more."""
        while self._put_off and not self._open:
            self._decide(self._put_off.popitem()[0])
        return self._open.pop() if self._open else None

    def _want(self, literal: Literal) -> None:
        variable = literal.variable
        if variable.relation == AT and variable.subject in self.free:
            return  # it drives there
        if literal not in self._wanted:
            self._wanted.add(literal)
            self._open.append(literal)

    def want_reading(self, literal: Literal, aboard: bool = False) -> None:
        """What can make a literal true that may be read off others."""
        (relation, subject), wanted = literal
        if not is_read_off(literal, self.world):
            self._want(literal)
        elif relation in (AT, ON, IN):
            self._want_at(subject, str(wanted), aboard)
        elif relation in (HELD, LOCATED):
            for robot in self.robots:
                self._want(Literal(FactKey(AT, subject), robot))
                if relation == HELD:
                    hand = subject if wanted is True else NOTHING
                    self._want(Literal(FactKey(HOLDING, robot), hand))
            if relation == LOCATED or wanted is not True:
                for place in self._places:
                    self._want(Literal(FactKey(AT, subject), place))
        else:
            for key in derived.read_by(literal, self._values, self.world, aboard=aboard):
                if key.relation not in (AT, HOLDING):
                    self._want(Literal(key, ANY))

    def _want_at(self, subject: str, where: str, aboard: bool) -> None:
        key = FactKey(AT, subject)
        values = [name for name in self._inside(where) if name in self.world.places]
        if where not in self.world.places:
            values += self._inside(where)
        if aboard and where in self.world.places:
            values += self.robots
            for robot in self.robots:
                self._want(Literal(FactKey(HOLDING, robot), NOTHING))
        values += [name for name in self._carriers if where in self.around(name)]
        values += [name for name in self._carriers if self.skills.writable(FactKey(AT, name))]
        for value in dict.fromkeys(values):
            if value != subject:
                self._want(Literal(key, value))
        if not self._thorough and self.skills.writable(key):
            return  # it can be taken there itself
        # it comes along with what carries it
        for carrier in (*self.around(subject), *self._carriers):
            if carrier in self.world.objects and self.skills.writable(FactKey(AT, carrier)):
                literal = Literal(FactKey(AT, carrier), where)
                if carrier not in (subject, where) and literal not in self._along:
                    self._along.add(literal)
                    self._want_at(carrier, where, aboard)

    def _carried_by(self, name: str) -> tuple[str, ...]:
        return tuple(derived.carriers(name, self.skills.known, self.world, aboard=True))

    def _with_parts(self, where: str) -> list[str]:
        """A place or thing, and its parts."""
        names = [where]
        for table in (self.world.places, self.world.objects):
            names += [
                name
                for name, entry in table.items()
                if entry.part_of is not None and derived.is_part(name, where, self.world)
            ]
        return list(dict.fromkeys(names))

    def want_formula(self, formula: Formula, positive: bool = True) -> None:
        match formula:
            case Holds(literal):
                if positive:
                    self.want_reading(literal)
                else:
                    self._want_change(literal)
            case Stored(literal):
                self._want(literal if positive else Literal(literal.variable, ANY))
            case Not(of):
                self.want_formula(of, not positive)
            case And(rows) if positive:
                for row in rows:
                    self.want_formula(row)
            case _:
                met = quorums(formula if positive else negation(formula))
                if met is not None:
                    for quorum in met:
                        self._want_quorum(quorum)
                elif isinstance(formula, Compare):
                    for term, more in directions(formula):
                        self._want_term(term, more is positive)
                else:
                    for row in conjuncts(negation(formula)):
                        self.want_formula(row)

    def _want_term(self, term: Term, more: bool) -> None:
        """What can make a number larger, or smaller."""
        match term:
            case Variable(key):
                self._want(Literal(key, ANY))
            case Sum(plus, minus):
                for part in plus:
                    self._want_term(part, more)
                for part in minus:
                    self._want_term(part, not more)
            case Total(_, _, where, of):
                if isinstance(of, Constant):
                    shrinks = isinstance(of.value, int | float) and of.value < 0
                    self.want_formula(where, more is not shrinks)
                    return
                self.want_formula(where)
                self.want_formula(where, False)
                self._want_term(of, more)

    def _want_quorum(self, quorum: Quorum) -> None:
        """So many of some formulas: of many, first those that are wanted anyway."""
        if len(quorum.of) > max(FEW, quorum.least) and self._breadth is Breadth.NARROW:
            self._put_off[quorum] = None
            return
        for row in quorum.of:
            self.want_formula(row)

    def _decide(self, quorum: Quorum) -> None:
        """Want those alternatives that were chosen, or all that it may take."""
        rows = [row for row in quorum.of if not self._holds_or_is_wanted(row)]
        least = quorum.least - (len(quorum.of) - len(rows))
        chosen: Collection[Formula] = ()
        if least > 0 and quorum in self._chosen:
            chosen = self._chosen[quorum]
        elif least > 0:
            self.undecided[quorum] = Quorum(tuple(rows), least)
            chosen = rows
        self.leaves_out |= any(row not in chosen for row in rows)
        for row in chosen:
            self.want_formula(row)

    def _holds_or_is_wanted(self, row: Formula) -> bool:
        """Whether a formula holds at the start, or would want nothing that is not wanted yet."""
        if evaluate(row, self._now, self.world):
            return True
        kept = self._wanted, self._along, self._put_off
        self._wanted, self._along, self._put_off = set(kept[0]), set(kept[1]), {}
        self.want_formula(row)
        wanted = not (self._open or self._put_off)
        self._open.clear()
        self._wanted, self._along, self._put_off = kept
        return wanted

    def _want_change(self, literal: Literal) -> None:
        for key in derived.read_by(literal, self._values, self.world):
            if key.relation == AT and key.subject in self.world.objects and not self._thorough:
                self._want_away(key)
            else:
                self._want(Literal(key, ANY))

    def _want_away(self, key: FactKey) -> None:
        """A thing somewhere else than where it is, wherever."""
        for value in (*self.robots, *self._places):
            if value != self.start.get(key):
                self._want(Literal(key, value))

    def make_room(self, carrier: str) -> None:
        """What lies in a full basket is taken out."""
        if carrier in self._looked_into:
            return
        self._looked_into.add(carrier)
        if not self._thorough and room_left(carrier, self.start, self.world) > 0:
            return
        for thing in self.world.objects:
            if self.start.get(FactKey(AT, thing)) == carrier:
                self._want_away(FactKey(AT, thing))

    def _that_carry(self) -> list[str]:
        """Things that a skill can put others on or in."""
        kinds = {row.kind_of(row.value) for row in self.skills.writers[AT]} - {None, ROBOT}
        return sorted(
            name
            for name in self.world.objects
            if any(kind is not None and self.skills.fits(kind, name) for kind in kinds)
        )
