"""Did it really happen? Goals against the truth of the simulated world.

Pure: what the planner says a goal means (`GoalStatus.conditions`) is held against what the physics
says (`Truth`, and where robots stand). What a worker or the planner claims plays no part.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum

import msgspec

from keyexpr_schema.goals import Condition, GoalState, GoalStatus
from keyexpr_schema.simulation import Truth


class Judgement(str, Enum):
    """What the physics says of a condition or a goal."""

    HOLDS = "holds"
    FAILS = "fails"
    NOT_JUDGED = "not judged by physics"


class ConditionVerdict(msgspec.Struct, frozen=True, kw_only=True):
    """One condition, and in a sentence why it holds or does not."""

    condition: Condition
    judgement: Judgement
    sentence: str


class Verdict(msgspec.Struct, frozen=True, kw_only=True):
    """One goal: what the physics says, what the planner says, and whether both say reached."""

    goal: str
    physics: Judgement
    planner: GoalState
    agreed: bool
    sentence: str
    conditions: tuple[ConditionVerdict, ...]


def judge(
    goals: Mapping[str, GoalStatus],
    truths: Mapping[str, Truth],
    robot_places: Mapping[str, str | None],
) -> tuple[Verdict, ...]:
    """A verdict on every goal, in the order of `goals`.

    `robot_places` says which place each robot really stands in (`None`: in none). `at(object)`
    holds when the object's truth is that place, settled and in nobody's hand; lying in a robot's
    basket counts, as the goal's definition says. `at(robot)` holds when the robot stands there.
    Nothing else can be seen by the physics. A goal with no conditions is not judged either.
    """
    return tuple(_verdict(status, truths, robot_places) for status in goals.values())


def all_agreed(verdicts: tuple[Verdict, ...]) -> bool:
    """Whether there are goals, and physics and planner both say of each that it is reached."""
    return bool(verdicts) and all(verdict.agreed for verdict in verdicts)


def _verdict(
    status: GoalStatus, truths: Mapping[str, Truth], robot_places: Mapping[str, str | None]
) -> Verdict:
    found = tuple(_condition(each, truths, robot_places) for each in status.conditions)
    seen = {each.judgement for each in found}
    if Judgement.FAILS in seen:
        physics = Judgement.FAILS
    elif Judgement.NOT_JUDGED in seen or not found:
        physics = Judgement.NOT_JUDGED
    else:
        physics = Judgement.HOLDS
    sentence = "; ".join(each.sentence for each in found) or (
        "nobody said what must hold for this goal, so there is nothing to judge"
    )
    if status.state is GoalState.REACHED and physics is Judgement.FAILS:
        sentence += " (but the planner says it is reached)"
    elif status.state is not GoalState.REACHED:
        why = f": {status.reason}" if status.reason else ""
        sentence += f" (the planner says {status.state.value}{why})"
    return Verdict(
        goal=status.goal,
        physics=physics,
        planner=status.state,
        agreed=physics is Judgement.HOLDS and status.state is GoalState.REACHED,
        sentence=sentence,
        conditions=found,
    )


def _condition(
    condition: Condition, truths: Mapping[str, Truth], robot_places: Mapping[str, str | None]
) -> ConditionVerdict:
    if condition.relation == "at" and condition.subject in truths:
        judgement, sentence = _object_at(truths[condition.subject], condition.value)
    elif condition.relation == "at" and condition.subject in robot_places:
        place = robot_places[condition.subject]
        holds = place == condition.value
        judgement = Judgement.HOLDS if holds else Judgement.FAILS
        aim = "" if holds else f", not in {condition.value}"
        sentence = f"{condition.subject} stands in {place or 'no known place'}{aim}"
    else:
        judgement = Judgement.NOT_JUDGED
        sentence = f"{condition} is not judged by physics"
    return ConditionVerdict(condition=condition, judgement=judgement, sentence=sentence)


def _object_at(truth: Truth, wanted: object) -> tuple[Judgement, str]:
    where = f"in {truth.place}" if truth.place else "in no known place"
    if truth.held_by is not None:
        return (
            Judgement.FAILS,
            f"{truth.object} is {where} but still in the hand of {truth.held_by}",
        )
    if not truth.settled:
        return Judgement.FAILS, f"{truth.object} is {where} but has not come to rest"
    on = f" on {truth.support}" if truth.support else ""
    if truth.place != wanted:
        return Judgement.FAILS, f"{truth.object} lies {where}{on}, not in {wanted}"
    return Judgement.HOLDS, f"{truth.object} lies {where}{on}"
