"""Verifies goals against the truth of the simulated world: did it really happen?

Pure: what the planner says a goal means (`GoalStatus.conditions`) is held against what the physics
says (`Truth`, and where robots stand). What a worker or the planner claims plays no part.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from enum import Enum
from typing import NamedTuple

import msgspec

from keyexpr_schema.facts import AT, HELD, IN, LOCATED, ON, SEARCHED, Value, render_value
from keyexpr_schema.payloads.goals import Condition, GoalState, GoalStatus
from keyexpr_schema.payloads.simulation import Truth
from keyexpr_schema.payloads.world import Object


class Verdict(str, Enum):
    """What the physics says of a condition or a goal."""

    HOLDS = "holds"
    FAILS = "fails"
    NOT_JUDGED = "not judged by physics"


class ConditionVerdict(msgspec.Struct, frozen=True, kw_only=True, rename={"verdict": "judgement"}):
    """One condition, and in a sentence why it holds or does not."""

    condition: Condition
    verdict: Verdict
    sentence: str


class GoalVerdict(msgspec.Struct, frozen=True, kw_only=True):
    """One goal: what the physics says, what the planner says, and whether both say reached."""

    goal: str
    physics: Verdict
    planner: GoalState
    agreed: bool
    sentence: str
    conditions: tuple[ConditionVerdict, ...]


def goal_verdicts(
    goals: Mapping[str, GoalStatus],
    truths: Mapping[str, Truth],
    robot_places: Mapping[str, str | None],
    beliefs: Mapping[str, Value] = {},
    objects: Mapping[str, Object] = {},
    wholes: Mapping[str, str | None] = {},
    visited: Collection[str] = (),
) -> tuple[GoalVerdict, ...]:
    """A verdict on every goal, in the order of `goals`.

    `robot_places` says which place each robot really stands in (`None`: in none), `beliefs` where
    the fleet takes each thing to be. `at(object)` holds when the object's truth is that place,
    settled and in nobody's hand; lying in a robot's basket counts, as the goal's definition says,
    and so does being on or in what is there. `at`, `on` and `in` a thing, a part of it or a person
    hold when that carries the object. States (`is_open`, `is_on`, …) are as the truth says;
    `objects` say what is part of what, `wholes` of places.
    `at(robot)` holds when the robot stands there, `held(object)` when a hand really holds it, and
    `located(object)` when the fleet takes it to be where it really is. `searched` holds of a place,
    and of a thing that is there, where a robot has really been: in one that is among `visited`.
    Nothing else can be seen by the physics. Of several subjects one is enough. A goal with no
    conditions is not judged either.
    """
    seen = _Seen(truths, robot_places, beliefs, objects, wholes, frozenset(visited))
    return tuple(_goal_verdict(status, seen) for status in goals.values())


class _Seen(NamedTuple):
    truths: Mapping[str, Truth]
    robot_places: Mapping[str, str | None]
    beliefs: Mapping[str, Value]
    objects: Mapping[str, Object]
    wholes: Mapping[str, str | None]
    visited: frozenset[str]

    def is_in(self, place: str | None, wanted: object) -> bool:
        """Whether a place is the one wanted, or a part of it."""
        left = len(self.wholes)
        while place is not None and place != wanted and left > 0:
            place, left = self.wholes.get(place), left - 1
        return place == wanted

    def carriers(self, thing: str) -> tuple[str, ...]:
        """What carries a thing directly and indirectly, and the wholes that those are part of."""
        found: list[str] = []
        at: str | None = thing
        while at is not None and at not in found[:-1]:
            truth, about = self.truths.get(at), self.objects.get(at)
            at = about.part_of if about and about.part_of else truth.support if truth else None
            if at is not None:
                found.append(at)
        return tuple(found)

    def root(self, thing: str) -> Truth:
        """The truth of the outermost object that carries a thing: it may be in a hand."""
        carriers = [self.truths[c] for c in self.carriers(thing) if c in self.truths]
        held = [truth for truth in carriers if truth.held_by is not None]
        return held[0] if held else self.truths[thing]


def all_agreed(verdicts: tuple[GoalVerdict, ...]) -> bool:
    """Whether there are goals, and physics and planner both say of each that it is reached."""
    return bool(verdicts) and all(verdict.agreed for verdict in verdicts)


def _goal_verdict(status: GoalStatus, seen: _Seen) -> GoalVerdict:
    found = tuple(_condition(each, seen) for each in status.conditions)
    verdicts = {each.verdict for each in found}
    if Verdict.FAILS in verdicts:
        physics = Verdict.FAILS
    elif Verdict.NOT_JUDGED in verdicts or not found:
        physics = Verdict.NOT_JUDGED
    else:
        physics = Verdict.HOLDS
    sentence = "; ".join(each.sentence for each in found) or (
        "nobody said what must hold for this goal, so there is nothing to judge"
    )
    if status.state is GoalState.REACHED and physics is Verdict.FAILS:
        sentence += " (but the planner says it is reached)"
    elif status.state is not GoalState.REACHED:
        why = f": {status.reason}" if status.reason else ""
        sentence += f" (the planner says {status.state.value}{why})"
    return GoalVerdict(
        goal=status.goal,
        physics=physics,
        planner=status.state,
        agreed=physics is Verdict.HOLDS and status.state is GoalState.REACHED,
        sentence=sentence,
        conditions=found,
    )


def _condition(condition: Condition, seen: _Seen) -> ConditionVerdict:
    """The best of what can be said of its subjects: one that holds is enough."""
    found = [_for_subject(condition, subject, seen) for subject in condition.subjects]
    verdicts = [verdict for verdict, _ in found]
    if Verdict.HOLDS in verdicts:
        verdict = Verdict.HOLDS
    else:
        unsure = Verdict.NOT_JUDGED in verdicts
        verdict = Verdict.NOT_JUDGED if unsure else Verdict.FAILS
    sentence = "; ".join(sentence for each, sentence in found if each is verdict)
    return ConditionVerdict(condition=condition, verdict=verdict, sentence=sentence)


def _for_subject(condition: Condition, subject: str, seen: _Seen) -> tuple[Verdict, str]:
    relation, wanted = condition.relation, condition.value
    if relation in (AT, ON, IN) and subject in seen.truths:
        if relation == AT and wanted not in seen.objects:
            return _object_at(seen.truths[subject], seen.root(subject), seen, wanted)
        return _carried(seen.truths[subject], seen, wanted)
    if subject in seen.truths and relation in seen.truths[subject].states:
        value = seen.truths[subject].states[relation]
        return _holds(value == wanted), f"{relation}({subject}) is {render_value(value)}"
    if relation == AT and subject in seen.robot_places:
        place = seen.robot_places[subject]
        there = seen.is_in(place, wanted)
        aim = "" if there else f", not in {wanted}"
        return _holds(there), f"{subject} stands in {place or 'no known place'}{aim}"
    if relation == HELD and subject in seen.truths:
        by = seen.truths[subject].held_by
        where = f"in the hand of {by}" if by else "in nobody's hand"
        return _holds((by is not None) is wanted), f"{subject} is {where}"
    if relation == SEARCHED and wanted is True:
        return _searched(subject, seen)
    if relation == LOCATED and wanted is True and subject in seen.truths:
        return _located(seen.truths[subject], seen)
    return Verdict.NOT_JUDGED, f"{condition} is not judged by physics"


def _holds(holds: bool) -> Verdict:
    return Verdict.HOLDS if holds else Verdict.FAILS


def _located(truth: Truth, seen: _Seen) -> tuple[Verdict, str]:
    """Whether the fleet has it where it is; what it takes to be on a robot is where that stands."""
    belief = seen.beliefs.get(truth.object)
    where = truth.place or "no known place"
    if belief is None:
        return Verdict.FAILS, f"{truth.object} lies in {where}, and the fleet does not know where"
    name = str(belief)
    place = seen.robot_places.get(name, name)
    right = seen.is_in(truth.place, place) or name in seen.carriers(truth.object)
    rest = "as the fleet says" if right else f"and the fleet says in {place}"
    return _holds(right), f"{truth.object} is in {where}, {rest}"


def _searched(subject: str, seen: _Seen) -> tuple[Verdict, str]:
    """Whether a robot has been where it was to look around, or where the thing is to look into."""
    where = seen.truths[subject].place if subject in seen.truths else subject
    been = any(seen.is_in(place, where) for place in seen.visited)
    return _holds(been), f"{'a' if been else 'no'} robot has been in {where or 'no known place'}"


def concerned(goals: Iterable[GoalStatus], truths: Mapping[str, Truth]) -> set[str]:
    """The things that must lie still before goals are judged: theirs, and what carries those."""
    conditions = [condition for status in goals for condition in status.conditions]
    left = [name for condition in conditions for name in condition.subjects if name in truths]
    found: set[str] = set()
    while left:
        name = left.pop()
        if name not in found:
            found.add(name)
            support = truths[name].support
            if support is not None and support in truths:
                left.append(support)
    return found


def _carried(truth: Truth, seen: _Seen, wanted: object) -> tuple[Verdict, str]:
    """Whether a thing, or a part of it, or a person carries an object."""
    if not truth.settled:
        return Verdict.FAILS, f"{truth.object} has not come to rest"
    if truth.held_by is not None:
        return Verdict.FAILS, f"{truth.object} is still in the hand of {truth.held_by}"
    at = truth.support or "nothing"
    return _holds(wanted in seen.carriers(truth.object)), f"{truth.object} is at {at}"


def _object_at(truth: Truth, root: Truth, seen: _Seen, wanted: object) -> tuple[Verdict, str]:
    where = f"in {truth.place}" if truth.place else "in no known place"
    if root.held_by is not None:
        return (
            Verdict.FAILS,
            f"{truth.object} is {where} but still in the hand of {root.held_by}",
        )
    if not truth.settled:
        return Verdict.FAILS, f"{truth.object} is {where} but has not come to rest"
    on = f" on {truth.support}" if truth.support else ""
    if not seen.is_in(truth.place, wanted):
        return Verdict.FAILS, f"{truth.object} lies {where}{on}, not in {wanted}"
    return Verdict.HOLDS, f"{truth.object} lies {where}{on}"
