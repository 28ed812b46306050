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
from keyexpr_schema.payloads.requests import ReplanRequest
from tests.support.fleet_model import COMPOSITION, FleetModel
from tests.support.household import bring, carrier, manipulator

ROOMS = ("hallway", "living_room")
PROGRAM = """
import sys
import msgspec
from fleet.core.planning_input import PlanningInput
from fleet.service.planning.planning_job import run_planning_job
from tests.support.fleet_model import COMPOSITION

for given in msgspec.msgpack.decode(sys.stdin.buffer.read(), type=list[PlanningInput]):
    answer = msgspec.structs.replace(run_planning_job(given, COMPOSITION), planning_time_s=0.0)
    sys.stdout.buffer.write(msgspec.json.encode(answer) + b"\\n")
"""


class Listened(FleetModel):
    """A fleet whose planning inputs are kept."""

    def run(self, given: PlanningInput) -> PlanningSucceeded | PlanningFailed:
        inputs.append(given)
        return super().run(given)


inputs: list[PlanningInput] = []
"""Every job that the missions below came to."""


def missions() -> list[PlanningInput]:
    """Jobs of running plans, too: a robot is lost, a cup is elsewhere, a cup is to be found."""
    inputs.clear()
    for strategy in (BIG_DAG, PER_GOAL, MONOLITHIC):
        robots = (manipulator("r1"), manipulator("r2"), carrier("c1"), carrier("c2"))
        model = Listened(robots, 4)
        model.learn("cup_4", "at", None)
        model.plan(*(bring(n, ROOMS[n % 2]) for n in range(1, 5)), strategy=strategy)
        model.succeed(model.orders()[0])
        model.learn("cup_1", "at", "hallway")
        model.lose("r2")
        ask = ReplanRequest(request="q", plan="plan-1", reason="so")
        model.receive(events.ReplanRequested, request=ask)
    allocators = sorted(COMPOSITION.allocators.keys() - {"llm"})
    first = next(given for given in inputs if given.job.strategy == PER_GOAL)
    return [
        *inputs,
        *(replace(first, job=replace(first.job, allocator=name)) for name in allocators),
    ]


def answers(jobs: list[PlanningInput], seed: int) -> list[bytes]:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        input=msgspec.msgpack.encode(jobs),
        capture_output=True,
        check=True,
        cwd=Path(__file__).parents[4],
        env={**os.environ, "PYTHONHASHSEED": str(seed)},
    )
    return done.stdout.splitlines()


def test_plans_do_not_depend_on_the_hashes_of_strings() -> None:
    jobs = missions()
    assert len(jobs) > 12
    assert len({job.job.residual is None for job in jobs}) == 2, "repairs are among them"
    one, other = answers(jobs, 1), answers(jobs, 2)
    assert len(one) == len(jobs)
    for job, mine, theirs in zip(jobs, one, other, strict=True):
        assert mine == theirs, (job.job.strategy, job.job.allocator, job.job.reason)
    assert sum(b'"PlanningSucceeded"' in line for line in one) > 12
