"""A running plan of 1,000 tasks on 50 robots: what losing a robot takes.

Run from anywhere: `python benchmarks/bench_running_plan.py` (or `make bench`). The planner's own
core and planning jobs, without keys: a plan is repaired after a lost robot as in the field, and
beside that, in the same run, everything is planned again, as a person's replan does. Wall times;
numbers are of this machine and of whatever else it was doing.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, field
from typing import Any

from msgspec.structs import replace
from rich.console import Console
from rich.table import Table

from fleet.core import events
from fleet.core.effects import MakePlan
from fleet.core.events import PlanningSucceeded
from fleet.core.indexes.plan_index import OUTSTANDING
from fleet.core.model.durations import FACTOR, MARGIN_S
from fleet.core.plan_entry import PlanEntry
from fleet.core.state import Policy, State
from fleet.core.step import step
from fleet.service.composition import Composition, compose
from fleet.service.planning.planning_job import run_planning_job
from fleet.service.skill_models import load_all_skills
from keyexpr_schema.facts import AT, HOLDING, NOTHING
from keyexpr_schema.payloads.goals import Condition, Goal
from keyexpr_schema.payloads.plans import PlanChange
from keyexpr_schema.payloads.requests import PlanRequest, ReplanRequest
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.tasks import Report, ReportState, TaskRecord
from keyexpr_schema.payloads.world import Fact, Object, Place

PLACES = 6
STEP_M = 4.0
DONE_BEFORE = 60
"""Tasks that have succeeded when the robot is lost."""


def main() -> None:
    """Print the table."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--robots", type=int, default=50)
    options.add_argument("--goals", type=int, default=250, help="of four tasks each")
    given = options.parse_args()
    table = Table(
        "what happens", "time", "makespan left", "least found", "actors moved", "tasks kept",
        "dropped", "added", title=f"{4 * given.goals} tasks on {given.robots} robots",
    )  # fmt: skip
    for happens in (lost, late, planned_again):
        running = Running(compose(), given.robots, given.goals)
        for _ in range(DONE_BEFORE):
            running.succeed()
        before = running.entry.outcome.allocation
        happens(running)
        entry, made = running.entry, running.made
        moved = sum(
            before.get(actor, robot) != robot for actor, robot in entry.outcome.allocation.items()
        )
        changed = entry.change or PlanChange()
        changes = [str(n) for n in (changed.kept, changed.dropped, changed.added)]
        least = next((n.split(" is ")[-1] for n in entry.outcome.notes if "least found" in n), "")
        table.add_row(
            (happens.__doc__ or "").split(".")[0],
            f"{made.planning_time_s:.2f} s",
            f"{made.predicted_makespan_s:.0f} s",
            least,
            str(moved) if made.repaired else "",
            *changes,
        )
    Console(width=140).print(table)


@dataclass
class Running:
    """The planner in the middle of a plan; robots take as long as predicted."""

    composition: Composition
    robots: int
    goals: int
    made: PlanningSucceeded = field(init=False)

    def __post_init__(self) -> None:
        self.state, self.time_s = State(), 0.0
        self.receive(
            events.PlannerStarted,
            epoch=1,
            incarnation="bench",
            skills=load_all_skills(),
        )
        for number in range(PLACES):
            ways = {f"room_{n}": abs(n - number) * STEP_M for n in range(PLACES) if n != number}
            place = Place(place=f"room_{number}", label=f"room {number}", travel_m=ways)
            self.receive(events.PlacePut, place=place)
        for number in range(self.robots):
            spec = RobotSpec(
                robot=f"r{number}", model="hsr",
                skills=("navigate", "pick", "place"),
                capabilities={"drive": 0.6, "see": 4.0, "grip": 1.2, "reach": 1.0},
            )  # fmt: skip
            self.receive(events.RobotRegistered, spec=spec)
            self.receive(events.WorkerConnected, robot=spec.robot, incarnation="i1")
            self.put_fact(spec.robot, HOLDING, NOTHING)
            self.put_fact(spec.robot, AT, f"room_{number % PLACES}")
        for number in range(self.goals):
            self.receive(
                events.ObjectPut,
                object=Object(object=f"c{number}", kind="cup", label=f"c{number}"),
            )
            self.put_fact(f"c{number}", AT, f"room_{number % PLACES}")
            wanted = f"room_{(number + 1 + number // PLACES % (PLACES - 1)) % PLACES}"
            condition = Condition(relation=AT, subject=f"c{number}", value=wanted)
            goal = Goal(goal=f"g{number}", text="", conditions=(condition,), ordinal=number)
            self.receive(events.GoalPut, goal=goal)
        self.receive(events.PlanRequested, request=PlanRequest(request="r", plan="p"))

    @property
    def entry(self) -> PlanEntry:
        """What is kept of the plan."""
        return self.state.plans["p"]

    def receive(self, kind: type[events.Event], wait_s: float = 0.0, **fields: Any) -> None:
        """One event; planning jobs are done at once."""
        self.time_s += wait_s
        at = {"time_s": self.time_s, "wall_time_s": self.time_s}
        self.state, effects = step(self.state, kind(**at, **fields))
        for effect in effects:
            if isinstance(effect, MakePlan):
                made = run_planning_job(effect.given, self.composition)
                if not isinstance(made, PlanningSucceeded):
                    raise SystemExit(f"there is no plan: {made.reason}")
                self.made = made
                self.state, _ = step(self.state, made)

    def put_fact(self, subject: str, relation: str, value: str) -> None:
        """A fact is put."""
        fact = Fact(subject=subject, relation=relation, value=value, source="bench")
        self.receive(events.FactPut, fact=fact)

    def outstanding(self) -> list[TaskRecord]:
        """Tasks that robots are at."""
        return [record for record in self.entry.records.values() if record.state in OUTSTANDING]

    def succeed(self) -> None:
        """Some robot starts its task and ends it."""
        record = self.outstanding()[0]
        report = self.report_of(record)
        self.receive(events.ReportReceived, report=report)
        done = replace(report, state=ReportState.SUCCEEDED, ended_s=self.time_s + record.duration_s)
        self.receive(events.ReportReceived, report=done)

    def report_of(self, record: TaskRecord) -> Report:
        """The report that the task has begun."""
        assert record.robot is not None
        return Report(
            robot=record.robot, plan="p", revision=record.revision, task=record.task,
            attempt=record.attempt, epoch=1, incarnation="i1", state=ReportState.STARTED,
            started_s=self.time_s,
        )  # fmt: skip


def lost(running: Running) -> None:
    """A robot is lost: the plan is repaired."""
    robot = running.outstanding()[-1].robot
    running.receive(events.WorkerDisconnected, robot=robot, incarnation="i1")
    running.receive(events.TimerFired, wait_s=Policy().lost_after_s + 1.0)


def late(running: Running) -> None:
    """A robot is ten minutes late: the plan is repaired."""
    record = running.outstanding()[-1]
    running.receive(events.ReportReceived, report=running.report_of(record))
    running.receive(events.TimerFired, wait_s=FACTOR * record.duration_s + MARGIN_S + 600.0)


def planned_again(running: Running) -> None:
    """A person wants another plan: everything is planned again."""
    ask = ReplanRequest(request="again", plan="p", reason="because")
    running.receive(events.ReplanRequested, request=ask)


if __name__ == "__main__":
    main()
