"""Grounding by relevance: only those actions that can help to make the goal true.

Backwards from the goal: an action is of use if it makes something true that the goal, or an action
that is of use, wants. What no skill can change is looked up while parameters are filled in, so that
no action is made that could never be done. Drives are not grounded: they are part of what an action
costs (`fleet.planners.symbolic.engine.travel`).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence

from fleet.core.model import derived
from fleet.core.model.formulas.evaluation import expanded
from fleet.core.model.formulas.nodes import FALSE, TRUE, Formula
from fleet.core.model.skills import Action, SkillModel
from fleet.core.model.world import WorldModel
from fleet.jobshop.time_budget import TimeBudget, Watch
from fleet.planners.symbolic.engine.alternatives import Quorum
from fleet.planners.symbolic.engine.instantiation import Binding, Facts, Instantiation
from fleet.planners.symbolic.engine.relevance import Row
from fleet.planners.symbolic.engine.wanted import Breadth, Wanted
from keyexpr_schema.facts import AT, FactKey, Literal, Value


class Grounding:
    """The actions of some robots that matter for a goal, and what stood in the way of others.

    `robots` are those looked at, `free` those of them that can drive wherever they are needed, with
    where they stand.
    If not THOROUGH, things are put down and handed over where something is that an action handles,
    where it shall be, or where robots are that cannot drive. `chosen` is that of `Wanted`.

    Raises:
        OutOfTime: the `budget` was over before.
    """

    def __init__(
        self,
        world: WorldModel,
        start: Facts,
        goal: Sequence[Literal],
        robots: Sequence[str],
        free: Mapping[str, Value],
        breadth: Breadth = Breadth.WIDE,
        budget: TimeBudget | None = None,
        chosen: Mapping[Quorum, Collection[Formula]] = {},
    ) -> None:
        self.world = world
        self.start = start
        self.goal = goal
        self.robots = robots
        self.free = free
        self.breadth = breadth
        self._thorough = breadth is Breadth.THOROUGH
        self._chosen = chosen
        self._watch = Watch(budget)
        self.skills = Instantiation(world, start, goal, robots, free)
        if self._thorough:
            self._ground(tuple(world.places))
            return
        spoken_of = {name for (_, subject), value in goal for name in (subject, value)}
        matter = self._where_are({*spoken_of, *(robot for robot in robots if robot not in free)})
        known: set[str] | None = None
        while known is None or not matter <= known:
            known = set(matter or world.places)
            self.skills.look_at(known)
            self._ground([place for place in world.places if place in known])
            handled = {name for action in self._made.values() for name in action.args.values()}
            matter = known | self._where_are(handled - self.free.keys())

    def _ground(self, places: Sequence[str]) -> None:
        self._wants = Wanted(
            self.skills, places, self.breadth, self._chosen, self._values, self._now
        )
        self._possible: dict[FactKey, set[Value]] = {}
        self._waiting: dict[FactKey, list[tuple[Row, Literal, Literal]]] = defaultdict(list)
        self._made: dict[tuple[str, tuple[str, ...]], Action] = {}
        for literal in self.goal:
            self._wants.want_reading(literal, aboard=True)
        while (wanted := self._wants.next()) is not None:
            self._watch.look()
            self._achieve(wanted)

    @property
    def leaves_out(self) -> bool:
        """Whether alternatives were left out."""
        return self._wants.leaves_out

    @property
    def undecided(self) -> Mapping[Quorum, Quorum]:
        """Alternatives of which none were chosen yet, with what is missing of them."""
        return self._wants.undecided

    @property
    def wider(self) -> Breadth | None:
        """How to look again where this leads nowhere; `None` if all was looked at."""
        if self._thorough:
            return None
        return Breadth.WIDE if self.leaves_out else Breadth.THOROUGH

    @property
    def actions(self) -> list[Action]:
        """All that are of use, in a fixed order."""
        return [self._made[key] for key in sorted(self._made)]

    def makers_of(self, literal: Literal) -> list[tuple[SkillModel, Binding]]:
        """The skills that could make a literal true, each with the parameters that this fixes."""
        literal = derived.written(literal, self.world)
        found = (
            (row, self.skills.unified(row, literal))
            for row in self.skills.writers[literal.variable[0]]
        )
        return [(row.skill, binding) for row, binding in found if binding is not None]

    def is_given_back(self, literal: Literal) -> bool:
        """Whether only some of the ways to make it true are looked at: what was taken, given back
        in the plainest way."""
        return any(
            self._taken_before(row, literal.value) is not None
            for row in self.skills.writers[literal.variable.relation]
            if self.skills.unified(row, literal) is not None
        )

    def may_come_along(self, literal: Literal) -> bool:
        """Whether what a literal is about, or says it is held, is on or in something that moves, so
        that it gets elsewhere by itself; or whether robots were refused a place for what it is."""
        names = (literal.variable.subject, literal.value)
        around = (
            carrier
            for name in names
            if isinstance(name, str)
            for carrier in self._wants.around(name)
        )
        return literal in self.skills.refused_there or any(
            self.skills.writable(FactKey(AT, carrier))
            for carrier in around
            if carrier in self.world.objects
        )

    def _where_are(self, names: Collection[Value]) -> set[str]:
        """The innermost places around things and robots, also in a hand; places themselves."""
        found = set[str]()
        for name in names:
            seen: set[Value] = set()
            while isinstance(name, str) and name not in self.world.places and name not in seen:
                seen.add(name)
                name = derived.carrier_of(name, self._now, self.world)
            if isinstance(name, str) and name in self.world.places:
                found.add(name)
        return found

    def _now(self, key: FactKey) -> Value:
        if key.relation == AT and key.subject in self.free:
            return self.free[key.subject]
        return self.skills.known(key)

    def _achieve(self, literal: Literal) -> None:
        for row in self.skills.writers.get(literal.variable.relation, ()):
            binding = self.skills.unified(row, literal)
            if binding is None:
                continue
            before = self._taken_before(row, literal.value)
            if before is not None:
                # It gives back what such actions take: only what has been taken matters, and of
                # several ways to give it back those that need nothing else.
                if not (self._thorough or row.is_plain) and any(
                    other.is_plain and other.value == row.value
                    for other in self.skills.writers[row.relation]
                ):
                    continue
                self._waiting[literal.variable].append((row, before, literal))
                for value in list(self._values(literal.variable)):
                    self._restore(row, before, binding, value, literal)
                continue
            for values in self.skills.completed(row.skill, binding, literal):
                self._add(row, values, literal)

    def _taken_before(self, row: Row, value: Value) -> Literal | None:
        """What a skill asks of a variable to which it gives back what others take, if it does."""
        before = next((b for b in row.skill.before if b.variable == row.variable), None)
        parameter = before is not None and before.value in row.skill.parameters
        return before if parameter and self.skills.restores(row.relation, value) else None

    def _restore(
        self, row: Row, before: Literal, binding: Binding, value: Value, wanted: Literal
    ) -> None:
        parameter = str(before.value)
        if not isinstance(value, str) or not self.skills.fits(
            row.skill.parameters[parameter], value
        ):
            return
        if binding.get(parameter, value) == value:
            for values in self.skills.completed(row.skill, {**binding, parameter: value}, None):
                self._add(row, values, wanted)

    def _values(self, variable: FactKey) -> set[Value]:
        """The values that a variable has now or that an action of use gives it."""
        if variable not in self._possible:
            self._possible[variable] = {self.skills.known(variable)}
        return self._possible[variable]

    def _add(self, row: Row, args: Binding, wanted: Literal) -> None:
        """The action, for what one of its effects makes true, and what that depends on."""
        if row.when != TRUE:
            when = expanded(row.depends_on(wanted, args), self.world)
            if when == FALSE:
                return
            self._wants.want_formula(when)
        skill = row.skill
        key = skill.name, tuple(args[name] for name in skill.parameters)
        if key in self._made:
            return
        action = self._made[key] = skill.ground(args)
        for literal in action.before:
            self._wants.want_reading(literal)
        for formula in action.conditions:
            self._wants.want_formula(expanded(formula, self.world))
        for carrier in action.space_in:
            self._wants.make_room(carrier)
        for literal in action.after:
            variable, value = derived.written(literal, self.world)
            known = self._values(variable)
            if value not in known:
                known.add(value)
                for row, before, wanted in self._waiting.get(variable, ()):
                    binding = self.skills.unified(row, wanted)
                    if binding is not None:
                        self._restore(row, before, binding, value, wanted)
