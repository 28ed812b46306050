"""Households: fleets, goals as task graphs, and how strategies join them into plans.

The graphs are data (household.yaml). A seed makes a household of them: durations, how many of what,
what is left out, and which robot can do what are drawn. A strategy joins the graphs of the goals:

* `per-goal`: side by side, each as if there were no other goal;
* `big-dag`: planned together: what two goals both need is done once for both;
* `monolithic`: one list of goals: each begins when the one before is done.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

from fleet.core.model.skill_file import skills_from_data
from fleet.core.model.world import WorldModel
from keyexpr_schema.facts import AT
from keyexpr_schema.ids import actor_arg
from keyexpr_schema.payloads.plans import Plan
from keyexpr_schema.payloads.plans import Task as PlanTask
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.world import Fact, Place
from keyexpr_schema.yaml_reader import read_yaml

STRATEGIES = ("big-dag", "per-goal", "monolithic")
CHANCE = 0.5
"""That a `maybe` task is there, and that a robot has a capability that its kind need not have."""
UNIT, REAL, WAYS = "unit", "real", "with ways"
CLOCKS = (UNIT, REAL, WAYS)
"""Every task takes 1 s and no way; real durations and no way; real durations and ways."""


@dataclass(frozen=True)
class Chore:
    """One task of one goal of one household."""

    name: str
    goal: str
    place: str
    needs: str
    duration_s: float
    after: tuple[str, ...]
    with_: str | None
    shared: bool


@dataclass(frozen=True)
class Household:
    """One draw of a scenario."""

    scenario: str
    seed: int
    robots: tuple[RobotSpec, ...]
    goals: tuple[str, ...]
    chores: tuple[Chore, ...]


@cache
def data() -> dict[str, Any]:
    """household.yaml."""
    loaded: dict[str, Any] = read_yaml(Path(__file__).with_name("household.yaml"), ValueError)
    return loaded


def scenarios() -> tuple[str, ...]:
    """Their names."""
    return tuple(data()["scenarios"])


def household(scenario: str, seed: int) -> Household:
    """The household that a seed draws; the same for the same arguments."""
    random = Random(f"{scenario} {seed}")
    scenario_data = data()["scenarios"][scenario]
    chores = [chore for goal in scenario_data["goals"] for chore in _chores(goal, random)]
    needed = sorted({chore.needs for chore in chores})
    robots: list[RobotSpec] = []
    for number, kind in enumerate(scenario_data["robots"], start=1):
        about = data()["kinds"][kind]
        has = {c for c in needed if c in about["has"] or random.random() < CHANCE}
        robots.append(
            RobotSpec(
                robot=f"{kind}_{number}",
                model=kind,
                skills=tuple(sorted(chore.name for chore in chores)),
                capabilities={"drive": about["speed_m_s"], **dict.fromkeys(sorted(has), 1.0)},
            )
        )
    return Household(scenario, seed, tuple(robots), tuple(scenario_data["goals"]), tuple(chores))


def _chores(goal: str, random: Random) -> list[Chore]:
    names: dict[str, list[str]] = {}
    made: list[Chore] = []
    for name, row in data()["goals"][goal].items():
        there = not row.get("maybe") or random.random() < CHANCE
        times = random.randint(*row.get("times", (1, 1))) if there else 0
        mine = [f"{goal}.{name}" if times == 1 else f"{goal}.{name}.{n + 1}" for n in range(times)]
        names[name] = mine
        befores = [b for before in row.get("after", ()) for b in names[before]]
        goes_on = names[row["with"]] if "with" in row else []
        made += [
            Chore(
                each,
                goal,
                row["at"],
                row["needs"],
                float(random.randint(*row["s"])),
                (*befores, *goes_on),
                goes_on[0] if goes_on else None,
                bool(row.get("shared")),
            )
            for each in mine
        ]
    return made


def plan_of(home: Household, strategy: str) -> Plan:
    """The goals' graphs as one plan; an actor for every chain of tasks that one robot goes on with.

    Raises:
        ValueError: there is no such strategy.
    """
    if strategy not in STRATEGIES:
        raise ValueError(f"no strategy {strategy}: choose one of {', '.join(STRATEGIES)}")
    stands_for: dict[str, str] = {}
    once: dict[str, str] = {}
    chores: list[Chore] = []
    for chore in home.chores:
        kind = chore.name.partition(".")[2]
        if strategy == "big-dag" and chore.shared and kind in once:
            stands_for[chore.name] = once[kind]
            continue
        once.setdefault(kind, chore.name)
        stands_for[chore.name] = chore.name
        chores.append(chore)
    number = {chore.name: f"t{n}" for n, chore in enumerate(chores, start=1)}
    actor: dict[str, str] = {}
    tasks: list[PlanTask] = []
    ends: tuple[str, ...] = ()
    for goal in home.goals:
        mine = [chore for chore in chores if chore.goal == goal]
        last = {chore.name for chore in mine} - {b for chore in mine for b in chore.after}
        for chore in mine:
            actor[chore.name] = (
                actor[chore.with_] if chore.with_ else f"a{len(set(actor.values())) + 1}"
            )
            befores = [stands_for[before] for before in chore.after]
            if strategy == "monolithic" and not befores:
                befores = list(ends)
            tasks.append(
                PlanTask(
                    task=number[chore.name],
                    skill=chore.name,
                    args={"robot": actor_arg(actor[chore.name]), "place": chore.place},
                    actor=actor[chore.name],
                    after=tuple(number[before] for before in befores),
                    goal=goal,
                )
            )
        ends = tuple(sorted(last))
    return Plan(plan="p", goals=home.goals, conditions=(), tasks=tuple(tasks), strategy=strategy)


def world_of(home: Household, clock: str) -> WorldModel:
    """The world in which tasks take what `clock` says; robots start in the hallway."""
    ways = data()["places"]
    metres = {(a, b): m for a, row in ways.items() for b, m in row.items()}
    metres |= {(b, a): m for (a, b), m in metres.items()}
    places = [
        Place(
            place=a,
            label=a,
            travel_m={b: metres[a, b] if clock == WAYS else 0.0 for b in ways if b != a},
        )
        for a in ways
    ]
    models = {
        chore.name: {
            "parameters": {"robot": "robot", "place": "place"},
            "needs": {"robot": [chore.needs]},
            "after": ["at(robot) = place"],
            "duration_s": 1.0 if clock == UNIT else chore.duration_s,
            "travel_to": "place",
        }
        for chore in home.chores
    }
    facts = [
        Fact(subject=robot.robot, relation=AT, value="hallway", source="household")
        for robot in home.robots
    ]
    return WorldModel.of(
        skills_from_data({"skills": models}, "household"), places, (), home.robots, facts
    )
