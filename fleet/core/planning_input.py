"""What goes to a planning process: everything that a job depends on, as one value.

Made by the core when a job begins, from the state at that moment. So an answer does not depend on
what happens meanwhile or on where the job runs, and a job that failed can be looked at later.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace as changed
from datetime import datetime
from typing import Any

import msgspec
from msgspec.structs import replace

from fleet.core.charging import charging_goal, taken_s
from fleet.core.model.energy import charging_s
from fleet.core.model.preconditions import action_of
from fleet.core.model.recurrence import said_at
from fleet.core.model.skills import SkillModel, Skills
from fleet.core.model.world import Hopeless, WorldModel
from fleet.core.plan_entry import PlanningJob
from fleet.core.standing import keepers, standing_constraints
from fleet.core.state import State
from fleet.language import Vocabulary
from fleet.language.words.own_words import OwnWords
from fleet.language.words.wordbook import wordbook_of
from keyexpr_schema.facts import CHARGE, SEARCHED, FactKey, Literal
from keyexpr_schema.payloads.closures import Closure
from keyexpr_schema.payloads.durations import Durations
from keyexpr_schema.payloads.goals import Condition, Goal, GoalState, GoalStatus
from keyexpr_schema.payloads.robots import FULL, RobotSpec
from keyexpr_schema.payloads.tasks import TaskRecord, TaskState
from keyexpr_schema.payloads.world import Object, Place


class WorkUnderWay(msgspec.Struct, frozen=True):
    """A task that a robot has an order for, as part of which actor."""

    skill: str
    args: dict[str, str]
    actor: str
    robot: str


class WorldInput(msgspec.Struct, frozen=True, kw_only=True):
    """The world as it was believed when a job began."""

    time_s: float
    wall_time_s: float
    skills: dict[str, SkillModel]
    places: tuple[Place, ...]
    objects: tuple[Object, ...]
    robots: tuple[RobotSpec, ...]
    available: tuple[str, ...]
    facts: tuple[Literal, ...]
    durations: tuple[Durations, ...]
    hopeless: tuple[Hopeless, ...] = ()
    """Calls that are not worth another try."""
    closures: tuple[Closure, ...] = ()
    """Where robots do not drive."""
    taken_s: dict[str, float] = {}
    """Chargers that other plans send robots to, and how long that takes yet."""

    def world(self) -> WorldModel:
        """The world that plans are made in."""
        return WorldModel(
            skills=self.skills,
            places={place.place: place for place in self.places},
            objects={thing.object: thing for thing in self.objects},
            robots={spec.robot: spec for spec in self.robots},
            available=frozenset(self.available),
            facts=dict(self.facts),
            durations={known.model: known for known in self.durations},
            hopeless=self.hopeless,
            closures=self.closures,
            taken_s=self.taken_s,
        )


class PlanningInput(WorldInput, frozen=True, kw_only=True, tag="plan"):
    """A planning job with the world it is planned in.

    `goals` have as their conditions what they still want; of those `reached`, that is what holds of
    them now. `busy_s` says for how long robots are taken [s from now], `under_way` what they do of
    the plan itself. `searched` are places in which this plan has looked around. The answer has to
    be there `limit_s` after the job began; by half of that, planners give what they have.
    """

    job: PlanningJob
    limit_s: float
    goals: tuple[Goal, ...]
    reached: tuple[str, ...] = ()
    searched: tuple[str, ...] = ()
    busy_s: dict[str, float] = {}
    under_way: tuple[WorkUnderWay, ...] = ()
    keepers: dict[str, str] = {}
    """Goals that stand for what always or never holds, by that as it is written."""


class InterpretationInput(WorldInput, frozen=True, kw_only=True, tag="interpret"):
    """A goal's sentence, which the grammar refuses, for a language model: with the reason, and with
    the names and skills that other words for it can use."""

    goal: str
    text: str
    refusal: str
    names: Vocabulary
    """Without the words of the language."""
    words: tuple[OwnWords, ...] = ()
    """What is added to those that are shipped."""
    now: datetime | None = None
    """What clocks showed when it was said."""

    def vocabulary(self) -> Vocabulary:
        """All that the sentence, and other words for it, can use."""
        return changed(self.names, language=wordbook_of(self.words))


def planning_input(state: State, job: PlanningJob) -> PlanningInput:
    """The job with everything of the state that it depends on; looks at the whole world once."""
    world = state.world()
    goals = [state.goals[goal] for goal in job.goals if goal in state.goals]
    reached = [g.goal for g in goals if state.goal_states[g.goal].state is GoalState.REACHED]
    always, never = standing_constraints(state)
    entry = state.plans.get(job.plan)
    wanted = (row for goal in goals for row in state.goal_states[goal.goal].conditions)
    own = {row.subject for row in wanted if row.relation == CHARGE}
    sent = (robot for robot in _sent_to_charge(state, job.plan) if robot not in own)
    charged = {FactKey(CHARGE, robot): int(FULL) for robot in sent}
    records = entry.records if entry is not None else {}
    return PlanningInput(
        **_believed(state, world.with_facts(charged)),
        job=job,
        limit_s=state.policy.planning_limit_s,
        goals=tuple(
            replace(
                goal,
                conditions=_wanted(state.goal_states[goal.goal], world),
                # What must hold until it is reached need not any longer.
                always=() if goal.goal in reached else (*goal.always, *always),
                never=() if goal.goal in reached else (*goal.never, *never),
                sometime_before=state.goal_states[goal.goal].still_in_order(goal),
            )
            for goal in goals
        ),
        reached=tuple(reached),
        searched=_searched(records.values(), state.skills),
        taken_s=taken_s(state, job.plan),
        busy_s=_busy_s(state, job.plan),
        under_way=tuple(
            WorkUnderWay(record.skill, record.args, record.actor, record.robot)
            for name in job.under_way
            if (record := records.get(name)) is not None and record.robot is not None
        ),
        hopeless=entry.hopeless if entry is not None else (),
        keepers=keepers(state) if always or never else {},
    )


def _believed(state: State, world: WorldModel) -> dict[str, Any]:
    """The fields of a `WorldInput`."""
    return {
        "time_s": state.time_s,
        "wall_time_s": state.wall_time_s,
        "skills": state.skills,
        "places": tuple(world.places.values()),
        "objects": tuple(world.objects.values()),
        "robots": tuple(world.robots.values()),
        "available": world.team,
        "facts": tuple(Literal(variable, value) for variable, value in world.facts.items()),
        "durations": tuple(world.durations.values()),
        "closures": world.closures,
    }


def interpretation_input(state: State, goal: str) -> InterpretationInput:
    """A goal's sentence with what a language model needs to know to say it otherwise."""
    words = state.vocabulary()
    return InterpretationInput(
        **_believed(state, state.world()),
        goal=goal,
        text=state.goals[goal].text,
        refusal=state.goal_states[goal].refusal or "",
        now=said_at(state.goals[goal], state.time_zones()),
        words=state.policy.words,
        names=changed(
            words,
            places=dict(words.places),
            objects=dict(words.objects),
            robots=dict(words.robots),
            whereabouts=dict(words.whereabouts),
            rests=dict(words.rests),
            carriers=dict(words.carriers),
            believed=dict(words.believed),
            speaker=state.goals[goal].speaker,
            language=None,
        ),
    )


def _wanted(status: GoalStatus, world: WorldModel) -> tuple[Condition, ...]:
    """What a goal still wants: all that it says, or, once reached, that what holds is kept."""
    if status.state is GoalState.REACHED:
        return tuple(condition for condition in status.conditions if world.holds(condition))
    return status.conditions


def _searched(records: Iterable[TaskRecord], skills: Skills) -> tuple[str, ...]:
    """Places that a finished task of the plan has searched."""
    return tuple(
        dict.fromkeys(
            literal.variable.subject
            for record in records
            if record.state is TaskState.SUCCEEDED
            and (action := action_of(record, skills)) is not None
            for literal in action.after
            if literal.variable.relation == SEARCHED
        )
    )


def _busy_s(state: State, plan: str) -> dict[str, float]:
    """How long robots are taken, s: by what they do late, by work of other plans than `plan`, whose
    own is in the new plan once more, and by charging, if they are sent to that. A task that is late
    is expected to take as long again as it has taken so far."""
    late_s: dict[str, float] = {}
    taken_s: dict[str, float] = {}
    for name, entry in state.plans.items():
        for record in entry.outstanding():
            if record.robot is None:
                continue
            begun_s = state.time_s if record.started_s is None else record.started_s
            left_s = begun_s + record.duration_s - state.time_s
            if record.started_s is not None:
                late_s.setdefault(record.robot, max(0.0, -left_s))
            if name != plan:
                taken_s.setdefault(record.robot, max(0.0, left_s))
    for robot in _sent_to_charge(state, plan):
        taken_s[robot] = taken_s.get(robot, 0.0) + charging_s(state.world(), robot)
    busy_s = {robot: late_s.get(robot, 0.0) + taken_s.get(robot, 0.0) for robot in state.robots}
    return {robot: wait_s for robot, wait_s in busy_s.items() if wait_s > 0.0}


def _sent_to_charge(state: State, plan: str) -> list[str]:
    """The robots that charge before they do anything for a plan."""
    sent = []
    for robot in state.robots:
        goal = charging_goal(state, robot)
        if goal is not None and plan not in state.index.plans_of.get(goal, ()):
            sent.append(robot)
    return sent
