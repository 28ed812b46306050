"""Many goals as the planner meets them: in planning jobs with a limit, revision by revision."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from fleet.core import events
from fleet.core.effects import Effect, MakePlan
from fleet.core.events import PlanningSucceeded
from fleet.core.model.world import WorldModel
from fleet.core.planning_input import PlanningInput
from fleet.core.state import LOGIC, Policy, State
from fleet.core.step import step
from fleet.service.composition import Composition
from fleet.service.planning.messages import ANSWER, HEADER, JOB, frame
from fleet.service.planning.planning_job import run_planning_job
from fleet.service.skill_models import load_all_skills
from keyexpr_schema.payloads.goals import Goal
from keyexpr_schema.payloads.requests import PlanRequest
from keyexpr_schema.payloads.world import Fact

PLAN = "p"


@dataclass(frozen=True)
class Jobs:
    """What the revisions of a plan came to: how many goals each has, how long its planning job took
    [s of processor time], and the makespan of the last one [s]."""

    goals: tuple[int, ...]
    took_s: tuple[float, ...]
    makespan_s: float


def jobs(
    world: WorldModel,
    goals: Sequence[Goal],
    strategy: str,
    limit_s: float,
    parts: Composition,
) -> Jobs:
    """A plan is asked for, and made again until no goal waits for its planning any more.

    A job is encoded, decoded, planned, checked and allocated, and its answer encoded and decoded,
    as between a planner and its planning process. The robots do nothing meanwhile.
    """
    state, at_s = State(), 0.0

    def received(kind: type[events.Event], **fields: Any) -> tuple[Effect, ...]:
        nonlocal state, at_s
        at_s += 0.001
        state, effects = step(state, kind(time_s=at_s, wall_time_s=at_s, **fields))
        return effects

    received(
        events.PlannerStarted,
        epoch=1,
        incarnation="benchmark",
        skills=load_all_skills(),
        logic=LOGIC,
        policy=Policy(planning_limit_s=limit_s),
    )
    for place in world.places.values():
        received(events.PlacePut, place=place)
    for thing in world.objects.values():
        received(events.ObjectPut, object=thing)
    for spec in world.robots.values():
        received(events.RobotRegistered, spec=spec)
        received(events.WorkerConnected, robot=spec.robot, incarnation="i1")
    for key, value in world.facts.items():
        fact = Fact(subject=key.subject, relation=key.relation, value=value, source="benchmark")
        received(events.FactPut, fact=fact)
    for goal in goals:
        received(events.GoalPut, goal=goal)
    effects = received(
        events.PlanRequested, request=PlanRequest(request="r", plan=PLAN, strategy=strategy)
    )
    planned: list[int] = []
    took_s: list[float] = []
    while made := [effect.given for effect in effects if isinstance(effect, MakePlan)]:
        began_s = time.process_time()
        answer = _answered(made[0], parts)
        took_s.append(time.process_time() - began_s)
        state, effects = step(state, answer)
        planned.append(len(state.plans[PLAN].plan.goals))
    return Jobs(
        tuple(planned), tuple(took_s), state.plans[PLAN].outcome.predicted_makespan_s or 0.0
    )


def _answered(given: PlanningInput, parts: Composition) -> PlanningSucceeded:
    asked = JOB.decode(frame(given)[HEADER.size :])
    assert isinstance(asked, PlanningInput)
    found = run_planning_job(asked, parts, time.process_time)
    answer = ANSWER.decode(frame(found)[HEADER.size :])
    if not isinstance(answer, PlanningSucceeded):
        raise SystemExit(f"there is no plan: {getattr(answer, 'reason', answer)}")
    return answer
