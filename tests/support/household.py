"""A small household for tests of the pure parts: three rooms, cups, two kinds of robots."""

from __future__ import annotations

from pathlib import Path

from fleet.core.checker.plan_checker import CheckedPlan, check_plan
from fleet.core.model.skills import SkillModel
from fleet.core.model.world import WorldModel
from fleet.service.skill_models import load_skills
from keyexpr_schema.ids import actor_arg
from keyexpr_schema.payloads.goals import Condition, Goal
from keyexpr_schema.payloads.plans import Plan, Task
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.world import Fact, Object, Place

SKILLS: dict[str, SkillModel] = load_skills(
    Path(__file__).parents[2] / "configs" / "skills" / "household.yaml"
)
UNLOAD = {
    "parameters": {"robot": "robot", "object": "object", "carrier": "robot", "place": "place"},
    "needs": {"robot": ["grip >= mass(object)"], "carrier": ["basket"]},
    "before": [
        "at(robot) = place",
        "at(carrier) = place",
        "at(object) = carrier",
        "holding(robot) = nothing",
    ],
    "after": ["holding(robot) = object", "at(object) = robot"],
}
"""Model of a skill that the household has not: taking something out of a basket."""
_TRAVEL_M = {
    "kitchen": {"hallway": 4.0, "living_room": 7.0},
    "hallway": {"kitchen": 4.0, "living_room": 4.0},
    "living_room": {"kitchen": 7.0, "hallway": 4.0},
}
PLACES = tuple(
    Place(place=name, label=name.replace("_", " "), travel_m=travel)
    for name, travel in _TRAVEL_M.items()
)


def cup(number: int, mass_kg: float = 0.15) -> Object:
    return Object(
        object=f"cup_{number}", kind="cup", label=f"cup {number}", ordinal=number, mass_kg=mass_kg
    )


def manipulator(name: str = "hsr", grip_kg: float = 1.2) -> RobotSpec:
    return RobotSpec(
        robot=name,
        model="hsr",
        skills=("navigate", "search", "pick", "place", "place_on_robot"),
        capabilities={"drive": 0.6, "see": 4.0, "grip": grip_kg, "reach": 1.0},
    )


def carrier(name: str = "locobot", basket: float = 2.0) -> RobotSpec:
    return RobotSpec(
        robot=name,
        model="locobot",
        skills=("navigate", "search"),
        capabilities={"drive": 0.6, "see": 4.0, "basket": basket},
    )


def fact(subject: str, relation: str, value: str | None, source: str = "test") -> Fact:
    return Fact(subject=subject, relation=relation, value=value, source=source)


def at(subject: str, place: str) -> Condition:
    return Condition(relation="at", subject=subject, value=place)


def bring(number: int, place: str, **more: int) -> Goal:
    return Goal(
        goal=f"g{number}",
        text=f"Bring cup {number} to the {place}",
        conditions=(at(f"cup_{number}", place),),
        ordinal=number,
        **more,
    )


def home(
    robots: tuple[RobotSpec, ...] = (manipulator(), carrier()),
    cups: int = 2,
    facts: tuple[Fact, ...] = (),
) -> WorldModel:
    """Cups in the kitchen, empty hands, robots that are nobody knows where."""
    known = (
        *(fact(f"cup_{n}", "at", "kitchen") for n in range(1, cups + 1)),
        *(fact(r.robot, "holding", "nothing") for r in robots if "grip" in r.capabilities),
        *facts,
    )
    return WorldModel.of(SKILLS, PLACES, tuple(cup(n) for n in range(1, cups + 1)), robots, known)


def checked(plan: Plan, world: WorldModel) -> CheckedPlan:
    """The plan, which must be valid, with its check."""
    found = check_plan(plan, world)
    assert isinstance(found, CheckedPlan), found.violations
    return found


def drives(*robots: str, after: dict[int, tuple[str, ...]] | None = None) -> Plan:
    """A plan of one drive for each; a name pins its actor to that robot, "" leaves it free."""
    tasks = [
        Task(
            task=f"t{n}",
            skill="navigate",
            args={"robot": actor_arg(f"a{n}"), "to": "kitchen"},
            actor=f"a{n}",
            after=(after or {}).get(n, ()),
        )
        for n in range(len(robots))
    ]
    pins = {f"a{n}": robot for n, robot in enumerate(robots) if robot}
    return Plan(plan="p", goals=(), conditions=(), tasks=tuple(tasks), pins=pins)
