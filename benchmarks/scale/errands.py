"""Fleets and plans of any size: every goal is a cup that one robot brings to the next room.

Four tasks a goal: navigate, pick, navigate, place. A plan is written down here and not searched
for, so that what is measured is what the planner does with a plan.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from fleet.core.events import At, PlanningSucceeded
from keyexpr_schema.facts import AT, HOLDING, NOTHING
from keyexpr_schema.ids import actor_arg
from keyexpr_schema.payloads.goals import Condition, Goal
from keyexpr_schema.payloads.plans import Plan, Task
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.world import Fact, Object, Place

ROOMS = 6
STEP_M = 4.0
SOURCE = "benchmark"
TASKS_A_GOAL = 4
DURATION_S = 30.0
_SKILLS = ("navigate", "pick", "navigate", "place")


def places() -> tuple[Place, ...]:
    """A row of rooms."""
    return tuple(
        Place(
            place=f"room_{number}",
            label=f"room {number}",
            travel_m={
                f"room_{other}": abs(other - number) * STEP_M
                for other in range(ROOMS)
                if other != number
            },
        )
        for number in range(ROOMS)
    )


def robot(number: int) -> RobotSpec:
    """A robot with a hand."""
    return RobotSpec(
        robot=f"r{number}",
        model="hsr",
        skills=("navigate", "pick", "place"),
        capabilities={"drive": 0.6, "see": 4.0, "grip": 1.2, "reach": 1.0},
    )


def robot_facts(number: int) -> tuple[Fact, Fact]:
    """Where it is, and that it holds nothing."""
    return (
        _fact(f"r{number}", HOLDING, NOTHING),
        _fact(f"r{number}", AT, f"room_{number % ROOMS}"),
    )


def cup(number: int) -> Object:
    """The cup of a goal."""
    return Object(object=f"cup_{number}", kind="cup", label=f"cup {number}", ordinal=number + 1)


def cup_fact(number: int) -> Fact:
    """Where the cup of a goal is at first."""
    return _fact(f"cup_{number}", AT, _origin(number))


def goal(number: int, sentence: bool = False, cups: int | None = None) -> Goal:
    """That cup `number` comes to the next room; by its condition, or as a `sentence` to be read.

    With fewer `cups` than goals, several goals are about one.
    """
    name, which = f"g{number}", _which(number, cups)
    if sentence:
        text = f"Bring cup {which + 1} to {_target(which).replace('_', ' ')}"
        return Goal(goal=name, text=text, ordinal=number)
    return Goal(goal=name, text="", conditions=(_condition(which),), ordinal=number)


@dataclass(frozen=True)
class Errands:
    """A plan for goals with these numbers, done by these robots in turn; `cups` as for `goal`."""

    plan: str
    numbers: Sequence[int]
    robots: int
    with_goals: bool = True
    cups: int | None = None

    @property
    def tasks(self) -> int:
        """How many tasks the plan has."""
        return TASKS_A_GOAL * len(self.numbers)

    def written(self, allocator: str = "round-robin") -> Plan:
        """The plan, every actor pinned to its robot."""
        tasks: list[Task] = []
        for place, number in enumerate(self.numbers):
            which = _which(number, self.cups)
            here, there = _origin(which), _target(which)
            thing = f"cup_{which}"
            arguments = (
                {"to": here},
                {"object": thing, "place": here},
                {"to": there},
                {"object": thing, "place": there},
            )
            for step, (skill, given) in enumerate(zip(_SKILLS, arguments, strict=True)):
                name = self.task(place, step)
                tasks.append(
                    Task(
                        task=name,
                        skill=skill,
                        args={"robot": actor_arg(f"a{place}"), **given},
                        actor=f"a{place}",
                        after=(self.task(place, step - 1),) if step else (),
                        goal=f"g{number}" if self.with_goals else None,
                        duration_s=DURATION_S,
                    )
                )
        return Plan(
            plan=self.plan,
            goals=tuple(f"g{number}" for number in self.numbers) if self.with_goals else (),
            conditions=tuple(_condition(_which(n, self.cups)) for n in self.numbers),
            tasks=tuple(tasks),
            allocator=allocator,
            pins=self.allocation,
        )

    def made(self, job: int, at: At) -> PlanningSucceeded:
        """What a planning job would say that came to this plan."""
        plan = self.written()
        sequence = {
            f"r{number}": tuple(
                f"a{place}" for place in range(number, len(self.numbers), self.robots)
            )
            for number in range(min(self.robots, len(self.numbers)))
        }
        behind: dict[str, tuple[str, ...]] = {
            self.task(place, 0): (self.task(place - self.robots, TASKS_A_GOAL - 1),)
            for place in range(self.robots, len(self.numbers))
        }
        return PlanningSucceeded(
            **at,
            job=job,
            plan=plan,
            allocation=self.allocation,
            sequence=sequence,
            extra_after=behind,
            durations_s={task.task: DURATION_S for task in plan.tasks},
            predicted_makespan_s=DURATION_S * self.tasks / self.robots,
            planning_time_s=0.0,
        )

    @property
    def allocation(self) -> dict[str, str]:
        """The robot of each actor."""
        return {f"a{place}": f"r{place % self.robots}" for place in range(len(self.numbers))}

    @staticmethod
    def task(place: int, step: int) -> str:
        """The name of a task: of which goal in the plan's order, and which of its four."""
        return f"t{TASKS_A_GOAL * place + step + 1}"


def _which(number: int, cups: int | None) -> int:
    return number if cups is None else number % cups


def _origin(number: int) -> str:
    return f"room_{number % ROOMS}"


def _target(number: int) -> str:
    return f"room_{(number + 1) % ROOMS}"


def _condition(number: int) -> Condition:
    return Condition(relation=AT, subject=f"cup_{number}", value=_target(number))


def _fact(subject: str, relation: str, value: str) -> Fact:
    return Fact(subject=subject, relation=relation, value=value, source=SOURCE)
