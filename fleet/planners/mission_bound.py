"""A makespan that no plan for some goals is below, whatever skills and robots it uses.

For each condition the time of the quickest action that can make it true, when what that needs is
there: the dearest need counts (h_max in time, Bonet and Geffner 2001), as far back as `DEPTH`. A
robot that a need names has to get from where it met that need to where it goes on. Beside that
stands the work on all things by the number of robots that can do any: each does one thing at a
time. What is not looked at counts nothing: formulas, room, things that come along with others.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from math import inf

from fleet.core.model import derived
from fleet.core.model.skills import SkillModel
from fleet.core.model.world import WorldModel
from fleet.jobshop.time_budget import TimeBudget
from fleet.planners.relaxed_world import ANYTHING, Binding, RelaxedWorld, takes, thing_of
from fleet.planners.symbolic.engine.relevance import Row, rows_of
from keyexpr_schema.facts import (
    AT,
    HELD,
    HOLDING,
    IN,
    LOCATED,
    NOTHING,
    ON,
    REACHABLE,
    FactKey,
    Literal,
)
from keyexpr_schema.payloads.goals import Condition, Goal

DEPTH = 4
"""How many actions before the last one are looked at; what those need counts nothing."""
Then = tuple[str, str] | None
"""A class of robots, and the place where its robot goes on; `None`: nobody needs to."""


def mission_bound_s(goals: Iterable[Goal], world: WorldModel, budget: TimeBudget) -> float:
    """Seconds that every plan for the goals takes at least, by the durations that are known; what
    the `budget` does not suffice for is not counted."""
    bound = _Bound(world, budget)
    longest_s, work_s = 0.0, defaultdict[str, float](float)
    for condition in (c for goal in goals for c in goal.conditions if not world.holds(c)):
        if budget.over:
            break
        reached_s = min(map(bound.reached_s, condition.literals))
        # What no skill leads to comes about otherwise, or not at all.
        longest_s = max(longest_s, reached_s if reached_s < inf else 0.0)
        if not condition.any_of:
            subject = condition.subject
            work_s[subject] = max(work_s[subject], bound.worked_s(condition))
    return max(longest_s, sum(work_s.values()) / max(1, bound.relaxed.hands))


class _Bound:
    def __init__(self, world: WorldModel, budget: TimeBudget) -> None:
        self._budget = budget
        self.relaxed = RelaxedWorld(world)
        self._world = world
        self._known: dict[tuple[Literal, Then, int], float] = {}

    def reached_s(self, literal: Literal) -> float:
        """When a literal of a goal holds at the earliest."""
        (relation, subject), value = literal
        world = self._world
        earliest_s = self._reached_s(literal, None, DEPTH)
        if relation == AT and subject in world.objects and value in world.places:
            for robot in self.relaxed.members:
                aboard = Literal(FactKey(AT, subject), robot)
                in_basket_s = self._at_s(aboard, (robot, str(value)), DEPTH, aboard=True)
                earliest_s = min(earliest_s, in_basket_s)
        return earliest_s

    def worked_s(self, condition: Condition) -> float:
        """What robots do with the subject at least, one after the other [s]."""
        subject, relaxed = condition.subject, self.relaxed
        if (
            subject not in self._world.objects
            or condition.relation not in (AT, ON, IN, HELD)
            or condition.value in self._world.robots
            or (condition.relation == HELD and condition.value is not True)
            or relaxed.comes_along(subject)
        ):
            return 0.0
        taken = (self._alone_s(row) for row in relaxed.rows[HOLDING] if thing_of(row) is not None)
        taken_s = min([*taken, relaxed.loose_s.get(HOLDING, inf)])
        least_s = taken_s
        if condition.relation != HELD:
            put = (
                self._alone_s(row) + (taken_s if _from_hand(row) else 0.0)
                for row in relaxed.rows[AT]
                if thing_of(row) is not None and not takes(row)
            )
            least_s = min([*put, relaxed.loose_s.get(AT, inf)])
        return least_s if least_s < inf else 0.0

    def _alone_s(self, row: Row) -> float:
        """The work of its skill; nothing if that is about several things at once."""
        things = {thing_of(other) for other in rows_of(row.skill)} - {None}
        return self.relaxed.quickest_s(row.skill) if len(things) == 1 else 0.0

    def _reached_s(self, literal: Literal, then: Then, depth: int) -> float:
        key = literal, then, depth
        if key not in self._known:
            least_s = 0.0 if then is None else self.relaxed.approach_s(*then)
            self._known[key] = max(least_s, self._sought_s(literal, then, depth))
        return self._known[key]

    def _sought_s(self, literal: Literal, then: Then, depth: int) -> float:
        (relation, subject), value = literal
        world, relaxed = self._world, self.relaxed
        if relation in (ON, IN) and (value in world.objects or value in world.robots):
            relation, literal = AT, Literal(FactKey(AT, subject), value)
        if depth == 0 or relaxed.holds(literal):
            return 0.0
        if relation == AT and subject in world.robots:
            known = subject in relaxed.members and value in world.places
            return relaxed.approach_s(subject, str(value)) if known else 0.0
        if relation == HELD and value is True:
            hands = (Literal(FactKey(HOLDING, robot), subject) for robot in relaxed.members)
            return min((self._reached_s(hand, None, depth) for hand in hands), default=0.0)
        if relation in (HELD, LOCATED, REACHABLE, ON, IN):
            return 0.0
        if relation == AT and subject in world.objects:
            return self._at_s(literal, then, depth, aboard=False)
        return self._made_s(literal, then, depth)

    def _at_s(self, literal: Literal, then: Then, depth: int, *, aboard: bool) -> float:
        """When a thing is at a place, a thing or a robot; with `aboard` in that robot's basket."""
        variable, value = literal
        if self.relaxed.comes_along(variable.subject):
            return 0.0
        in_hand = not (aboard and self.relaxed.hands_put)
        if value not in self._world.places:
            return self._made_s(literal, then, depth, in_hand=in_hand)
        spots = self.relaxed.places_in(str(value))
        best_s = min(self._made_s(Literal(variable, spot), then, depth) for spot in spots)
        return min(best_s, self._on_fixed_s(literal, then, depth), self._on_moved_s(literal, depth))

    def _on_fixed_s(self, literal: Literal, then: Then, depth: int) -> float:
        """When it is on or in something that does not move, there."""
        variable, place = literal
        world, best_s = self._world, inf
        for thing in world.objects:
            if not self.relaxed.moves(thing):
                where = tuple(derived.carriers(thing, world.facts.get, world))
                if place in where or not derived.is_located(thing, world.facts.get, world):
                    best_s = min(best_s, self._made_s(Literal(variable, thing), then, depth))
        return best_s

    def _on_moved_s(self, literal: Literal, depth: int) -> float:
        """When it is on or in something that is brought there, or is there now."""
        variable, place = literal
        put_s = self._made_s(Literal(variable, ANYTHING), None, depth)
        if put_s == inf:
            return inf
        others = (t for t in self._world.objects if t != variable.subject and self.relaxed.moves(t))
        brought = (
            self._reached_s(Literal(FactKey(AT, t), place), None, min(depth - 1, 1)) for t in others
        )
        return max(put_s, min(brought, default=inf))

    def _made_s(self, literal: Literal, then: Then, depth: int, *, in_hand: bool = True) -> float:
        """When the quickest action is done that makes it true; not one that takes it `in_hand`, if
        that would not do."""
        relaxed = self.relaxed
        best_s = relaxed.loose_s.get(literal.variable.relation, inf)
        for row, fixed in relaxed.steps(literal):
            if not in_hand and takes(row):
                continue
            for binding in relaxed.filled(row.skill, fixed):
                if self._budget.over:
                    return 0.0
                stands = _stands(row.skill, binding)
                least_s = self._world.work_s(binding[row.skill.actor_parameter], row.skill)
                if then is not None:
                    least_s += self._goes_on_s(row, fixed, stands, then)
                before_s = max(
                    (relaxed.approach_s(binding[n], p) for n, p in stands.items()), default=0.0
                )
                for need in row.skill.before:
                    if before_s + least_s >= best_s:
                        break
                    before_s = max(before_s, self._needed_s(need, binding, stands, depth))
                best_s = min(best_s, before_s + least_s)
        return best_s

    def _goes_on_s(
        self, row: Row, fixed: Binding, stands: Mapping[str, str], then: tuple[str, str]
    ) -> float:
        """The way of the robot that the literal names from where the action is done."""
        moved = {other.variable.subject for other in rows_of(row.skill) if other.relation == AT}
        named = (n for n, robot in fixed.items() if robot == then[0] and n in stands)
        ways = (self.relaxed.way_s(then[0], stands[n], then[1]) for n in named if n not in moved)
        return max(ways, default=0.0)

    def _needed_s(
        self, need: Literal, binding: Binding, stands: Mapping[str, str], depth: int
    ) -> float:
        (relation, subject), value = need
        if subject not in binding or (subject in stands and relation == AT) or value == NOTHING:
            return 0.0
        if isinstance(value, str):
            if value not in binding:
                return 0.0  # a parameter that is left open, or a word
            value = binding[value]
        literal = Literal(FactKey(relation, binding[subject]), value)
        # Whom the need names goes on here; another robot of its class would not do.
        named = [n for n in (subject, need.value) if isinstance(n, str) and n in stands]
        goes_on = [self._reached_s(literal, (binding[n], stands[n]), depth - 1) for n in named]
        return max(goes_on) if goes_on else self._reached_s(literal, None, depth - 1)


def _from_hand(row: Row) -> bool:
    """Whether a hand must hold the thing that the row is about."""
    return any(
        need.variable.relation == HOLDING and need.value == thing_of(row)
        for need in row.skill.before
    )


def _stands(skill: SkillModel, binding: Binding) -> dict[str, str]:
    """Where its robots have to be, by parameter, as far as that is filled in."""
    return {
        subject: binding[value]
        for (relation, subject), value in skill.before
        if relation == AT
        and subject in skill.robot_parameters
        and isinstance(value, str)
        and value in binding
    }
