"""The checker goes through what each robot's battery has along its tasks, and refuses what it is
not enough for however often the robot charges between them."""

from __future__ import annotations

import msgspec

from fleet.core.checker.plan_checker import check_plan
from fleet.core.model.eligibility import lacks
from fleet.core.model.skill_file import skills_from_data
from fleet.core.model.world import WorldModel
from fleet.planners.base import NoPlan, PlanningProblem
from fleet.service.composition import compose
from keyexpr_schema.ids import actor_arg
from keyexpr_schema.payloads.plans import Plan, Task
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.world import Fact, Object, Place
from tests.support.battery_fleet import CHARGER, SMALL, powered
from tests.support.household import PLACES, SKILLS, at, bring, cup, fact, manipulator

SWAP = skills_from_data(
    {"skills": {"swap": {"parameters": {"robot": "robot"}, "after": ["charge(robot) = 100"]}}}, "t"
)
BARN_M = 60.0


def world(
    charge: int, *things: Object, robots: tuple[RobotSpec, ...] = (), here: str = "kitchen"
) -> WorldModel:
    """One robot with a hand, two cups, and a barn that is far away."""
    to_barn = {place.place: BARN_M for place in PLACES}
    barn = Place(place="barn", label="barn", travel_m=to_barn)
    rooms = [
        msgspec.structs.replace(place, travel_m={**place.travel_m, "barn": BARN_M})
        for place in PLACES
    ]
    team = robots or (powered(manipulator()),)
    facts = [
        fact("cup_1", "at", "kitchen"),
        fact("cup_2", "at", "kitchen"),
        *(fact(each.robot, "at", here) for each in team),
        *(fact(each.robot, "holding", "nothing") for each in team),
        *(Fact(subject=r.robot, relation="charge", value=charge, source="t") for r in team),
    ]
    return WorldModel.of({**SKILLS, **SWAP}, (*rooms, barn), (cup(1), cup(2), *things), team, facts)


def tasks(*calls: tuple[str, dict[str, str]]) -> Plan:
    """What one actor does in a row."""
    made = tuple(
        Task(
            task=f"t{n}",
            skill=skill,
            args={"robot": actor_arg("a1"), **args},
            actor="a1",
            after=(f"t{n - 1}",) if n else (),
        )
        for n, (skill, args) in enumerate(calls)
    )
    return Plan(plan="p", goals=(), conditions=(), tasks=made)


def fetched(number: int) -> list[tuple[str, dict[str, str]]]:
    name = f"cup_{number}"
    return [
        ("navigate", {"to": "kitchen"}),
        ("pick", {"object": name, "place": "kitchen"}),
        ("navigate", {"to": "living_room"}),
        ("place", {"object": name, "place": "living_room"}),
    ]


def refused(plan: Plan, model: WorldModel) -> str:
    return "; ".join(violation.sentence for violation in check_plan(plan, model).violations)


def test_where_nobody_can_charge_the_charge_is_enough_for_all_tasks_or_it_is_refused() -> None:
    assert not refused(tasks(*fetched(1)), world(50))
    why = refused(tasks(*fetched(1), *fetched(2)), world(50))
    assert why == (
        "no robot can be actor a1: hsr has 0.159 Wh, and t4 (navigate) needs 0.339 Wh; charge first"
    )


def test_with_a_charger_a_robot_charges_between_its_tasks() -> None:
    assert not refused(tasks(*fetched(1), *fetched(2)), world(50, CHARGER))
    assert not refused(tasks(*fetched(1), *fetched(2)), world(5, CHARGER))


def test_what_recharges_in_a_plan_counts() -> None:
    swaps = powered(manipulator())
    swaps = msgspec.structs.replace(swaps, skills=(*swaps.skills, "swap"))
    model = world(50, robots=(swaps,))
    assert refused(tasks(*fetched(1), *fetched(2)), model)
    assert not refused(tasks(*fetched(1), ("swap", {}), *fetched(2)), model)


def test_a_place_from_which_no_full_battery_leads_back_is_refused() -> None:
    there = tasks(("navigate", {"to": "barn"}))
    why = refused(there, world(100, CHARGER))
    assert why == (
        "no robot can be actor a1: hsr's battery holds 3 Wh, and t0 (navigate) takes 2.25 Wh with "
        "the way to it, and 2.4 Wh to get to a charger after"
    )
    large = powered(manipulator(), msgspec.structs.replace(SMALL, capacity_wh=6.0))
    assert not refused(there, world(100, CHARGER, robots=(large,)))
    # One that is there already has more than it would have if it came from a charger.
    search = tasks(("search", {"place": "barn"}))
    assert not refused(search, world(100, CHARGER, here="barn"))
    assert refused(search, world(30, CHARGER, here="barn"))


def test_who_can_do_something_on_no_battery_is_left_out_with_that_reason() -> None:
    tiny = msgspec.structs.replace(SMALL, capacity_wh=1.0)
    weak = powered(manipulator("weak"), tiny)
    model = world(100, CHARGER, robots=(weak,))
    pick = SKILLS["pick"].ground({"robot": "weak", "object": "cup_1", "place": "kitchen"})
    place = SKILLS["navigate"].ground({"robot": "weak", "to": "barn"})
    assert lacks(model, "weak", pick, "robot") is None
    assert (lacks(model, "weak", place, "robot") or "").startswith("weak's battery holds 1 Wh")
    planner = compose().planners["symbolic"]
    alone = planner.plan(PlanningProblem(plan="p", goals=(bring(1, "barn"),), world=model))
    assert isinstance(alone, NoPlan)
    assert "weak's battery holds 1 Wh" in alone.reason
    strong = powered(manipulator("strong"), msgspec.structs.replace(SMALL, capacity_wh=12.0))
    both = world(100, CHARGER, robots=(weak, strong))
    made = planner.plan(PlanningProblem(plan="p", goals=(bring(1, "barn"),), world=both))
    assert not isinstance(made, NoPlan)
    assert set(made.able.values()) == {("strong",)}
    assert made.plan.conditions == (at("cup_1", "barn"),)
