"""The same input makes the same plan in whatever process: no hash of a string decides anything."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import msgspec
from msgspec.structs import replace

from fleet.core import events
from fleet.core.events import PlanningFailed, PlanningSucceeded
from fleet.core.planning_input import PlanningInput
from fleet.planners.base import BIG_DAG, MONOLITHIC, PER_GOAL
from fleet.service.planning.planning_job import run_planning_job
from keyexpr_schema.payloads.requests import ReplanRequest
from tests.support.fleet_model import COMPOSITION, FleetModel
from tests.support.household import bring, carrier, manipulator


class Job(msgspec.Struct, frozen=True, kw_only=True):
    """What a planning process was given, and what it answered."""

    given: PlanningInput
    answer: PlanningSucceeded | PlanningFailed


ROOMS = ("hallway", "living_room")
PROGRAM = "from tests.unit.service.planning.test_planning_determinism import missions; missions()"


class Listened(FleetModel):
    """A fleet whose planning jobs are told: what each was given, and what it came to."""

    def run(self, given: PlanningInput) -> PlanningSucceeded | PlanningFailed:
        self.first = given
        answer = super().run(given)
        tell(given, answer)
        return answer


def tell(given: PlanningInput, answer: PlanningSucceeded | PlanningFailed) -> None:
    job = Job(given=given, answer=replace(answer, planning_time_s=0.0))
    sys.stdout.buffer.write(msgspec.json.encode(job) + b"\n")


def missions() -> None:
    """Jobs of running plans, too: a robot is lost, a cup is elsewhere, a cup is to be found."""
    for strategy in (BIG_DAG, PER_GOAL, MONOLITHIC):
        robots = (manipulator("r1"), manipulator("r2"), carrier("c1"), carrier("c2"))
        model = Listened(robots, 4)
        model.learn("cup_4", "at", None)
        model.plan(*(bring(n, ROOMS[n % 2]) for n in range(1, 5)), strategy=strategy)
        given = model.first
        model.succeed(model.orders()[0])
        model.learn("cup_1", "at", "hallway")
        model.lose("r2")
        ask = ReplanRequest(request="q", plan="plan-1", reason="so")
        model.receive(events.ReplanRequested, request=ask)
        if strategy != PER_GOAL:
            continue
        for name in sorted(COMPOSITION.allocators.keys() - {"llm"}):
            other = replace(given, job=replace(given.job, allocator=name))
            tell(other, run_planning_job(other, COMPOSITION))


def told_with(seed: int) -> list[bytes]:
    """What a process tells of all these jobs, with hashes of its own."""
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        capture_output=True,
        check=True,
        cwd=Path(__file__).parents[4],
        env={**os.environ, "PYTHONHASHSEED": str(seed)},
    )
    return done.stdout.splitlines()


def test_plans_do_not_depend_on_the_hashes_of_strings() -> None:
    told = [told_with(seed) for seed in (1, 2)]
    jobs = [msgspec.json.decode(line, type=Job) for line in told[0]]
    assert len(jobs) > 12
    assert len({job.given.job.residual is None for job in jobs}) == 2, "repairs are among them"
    for job, mine, theirs in zip(jobs, *told, strict=True):
        of = job.given.job
        assert mine == theirs, (of.strategy, of.allocator, of.reason)
    assert sum(isinstance(job.answer, PlanningSucceeded) for job in jobs) > 12
