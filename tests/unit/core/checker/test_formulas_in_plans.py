"""What the checker says of conditions that are more than one variable's value."""

from __future__ import annotations

import sys
from dataclasses import replace as changed
from types import FrameType

import pytest
from msgspec.structs import replace

from fleet.core.checker.plan_checker import CheckedPlan, check_allocation, check_plan
from fleet.core.model.skill_file import skills_from_data
from fleet.core.model.world import WorldModel
from keyexpr_schema.facts import FactKey, Value
from keyexpr_schema.ids import actor_arg
from keyexpr_schema.payloads.goals import Condition, Precedence
from keyexpr_schema.payloads.plans import Plan, Task
from keyexpr_schema.payloads.world import Object
from tests.support.household import home, manipulator

SKILLS = skills_from_data(
    {
        "skills": {
            "fetch": {
                "parameters": {"robot": "robot", "object": "movable"},
                "before": ["reachable(object) = true", "holding(robot) = nothing"],
                "after": ["at(object) = robot", "holding(robot) = object"],
            },
            "stow": {
                "parameters": {"robot": "robot", "object": "movable", "into": "contains"},
                "before": ["holding(robot) = object", "space(into)"],
                "after": ["in(object) = into", "holding(robot) = nothing"],
            },
            "shut": {
                "parameters": {"robot": "robot", "door": "openable"},
                "before": ["any(x: movable, in(x) = door)"],
                "after": ["is_open(door) = false"],
            },
            "carry": {
                "parameters": {"robot": "robot", "object": "contains", "to": "place"},
                "after": ["at(object) = to"],
            },
            "mark": {
                "parameters": {"robot": "robot", "object": "movable"},
                "after": ["marked(object) = true"],
            },
            "seal": {
                "parameters": {"robot": "robot", "object": "movable"},
                "after": ["sealed(object) = true"],
            },
            "audit": {
                "parameters": {"robot": "robot", "box": "contains"},
                "before": [
                    "count(x: movable, sealed(x) = true) <= count(x: movable, marked(x) = true)"
                ],
                "after": ["audited(box) = true"],
            },
            "rinse": {
                "parameters": {"robot": "robot", "box": "contains"},
                "after": ["all(x: movable, if at(x) = box: wet(x) = true)"],
            },
        }
    },
    "here",
)
BOX = Object(object="box", kind="box", label="box", features=("contains", "openable"), room=1)


def house(facts: dict[FactKey, Value], things: int = 2) -> WorldModel:
    robots = tuple(replace(manipulator(name), skills=tuple(SKILLS)) for name in ("r1", "r2"))
    world = home(robots, cups=things)
    return changed(
        world.with_facts({FactKey("at", "box"): "kitchen", **facts}),
        skills=SKILLS,
        objects={**world.objects, "box": BOX},
    )


def task(name: str, skill: str, actor: str, after: tuple[str, ...] = (), **args: str) -> Task:
    given = {"robot": actor_arg(actor), **args}
    return Task(task=name, skill=skill, args=given, actor=actor, after=after)


def plan(*tasks: Task, goal: Condition | None = None) -> Plan:
    return Plan(plan="p", goals=(), conditions=(goal,) if goal else (), tasks=tasks)


OPEN = {FactKey("is_open", "box"): True}


def test_what_is_in_something_that_others_may_close_cannot_be_counted_on() -> None:
    inside = {FactKey("at", "cup_1"): "box", **OPEN}
    fetch = task("t1", "fetch", "a1", object="cup_1")
    assert not check_plan(plan(fetch), house(inside)).violations
    shut = task("t2", "shut", "a2", door="box")
    found = check_plan(plan(fetch, shut), house(inside)).violations
    # Once it was fetched, nothing is in the box that would need to be shut in.
    assert {(v.code, v.task) for v in found} == {
        ("condition-undone", "t1"),
        ("condition-undone", "t2"),
    }
    sentences = {v.task: v.sentence for v in found}
    assert sentences["t1"] == ("t1 needs reachable(cup_1) = true, and that need not hold after t2")
    assert "t2 needs " in sentences["t2"]
    (closed,) = check_plan(plan(fetch), house({FactKey("at", "cup_1"): "box"})).violations
    assert closed.code == "condition-unmet"
    assert closed.condition == Condition(relation="reachable", subject="cup_1", value=True)
    assert closed.sentence.endswith("that does not hold at the start")


def test_a_box_that_moves_takes_along_what_is_in_it() -> None:
    goal = Condition(relation="at", subject="cup_1", value="hallway")
    carry = task("t1", "carry", "a1", object="box", to="hallway")
    inside = house({FactKey("at", "cup_1"): "box"})
    assert not check_plan(plan(carry, goal=goal), inside).violations
    assert check_plan(plan(carry, goal=goal), house({})).violations
    # Where the order of two trips is open, it may end in either place.
    back = task("t2", "carry", "a2", object="box", to="kitchen")
    assert check_plan(plan(carry, back, goal=goal), inside).violations
    carry = replace(carry, after=("t2",))
    assert not check_plan(plan(carry, back, goal=goal), inside).violations


def test_a_box_takes_no_more_than_it_has_room_for() -> None:
    held = {
        FactKey(relation, subject): value
        for relation, subject, value in (
            ("holding", "r1", "cup_1"),
            ("at", "cup_1", "r1"),
            ("holding", "r2", "cup_2"),
            ("at", "cup_2", "r2"),
        )
    }
    one = task("t1", "stow", "a1", object="cup_1", into="box")
    two = task("t2", "stow", "a2", object="cup_2", into="box")
    assert not check_allocation(plan(one), house(held), {"a1": "r1"})
    found = check_allocation(plan(one, two), house(held), {"a1": "r1", "a2": "r2"})
    assert [(v.code, v.task) for v in found] == [("condition-undone", "t1")]
    assert found[0].sentence == "t1 needs room on or in box, and that need not hold after t2"
    full = house({**held, FactKey("at", "cup_2"): "box"})
    (found_full,) = check_allocation(plan(one), full, {"a1": "r1"})
    assert found_full.sentence == (
        "t1 needs room on or in box, and that does not hold at the start"
    )


def test_an_effect_that_depends_does_so_in_every_order() -> None:
    goal = Condition(relation="wet", subject="cup_1", value=True)
    rinse = task("t2", "rinse", "a2", box="box")
    stow = task("t1", "stow", "a1", object="cup_1", into="box")
    held = house({FactKey("holding", "r1"): "cup_1", FactKey("at", "cup_1"): "r1"})
    allocation = {"a1": "r1", "a2": "r2"}
    assert check_allocation(plan(stow, rinse, goal=goal), held, allocation)
    after = replace(rinse, after=("t1",))
    assert not check_allocation(plan(stow, after, goal=goal), held, allocation)


def pairs(count: int) -> tuple[Task, ...]:
    return tuple(
        row
        for n in range(count)
        for row in (
            task(f"m{n}", "mark", f"m{n}", object=f"cup_{n + 1}"),
            task(f"s{n}", "seal", f"s{n}", (f"m{n}",), object=f"cup_{n + 1}"),
        )
    )


def test_where_too_many_orders_are_open_the_plan_says_which_to_close() -> None:
    audit = task("t1", "audit", "a1", box="box")
    assert not check_plan(plan(*pairs(4), audit), house({}, things=4)).violations
    found = check_plan(plan(*pairs(20), audit), house({}, things=20)).violations
    assert [(v.code, v.task) for v in found] == [("too-many-orders", "t1")]
    assert "say which of m0, s0, m1" in found[0].sentence


@pytest.mark.parametrize("late", [True, False])
def test_with_their_order_said_there_are_few(late: bool) -> None:
    tasks = pairs(20)
    rows = [replace(t, after=(tasks[n - 1].task,)) if n else t for n, t in enumerate(tasks)]
    audit = task("t1", "audit", "a1", (rows[-1].task,) if late else (), box="box")
    assert not check_plan(plan(*rows, audit), house({}, things=20)).violations


def calls_to_check(goals: int) -> int:
    """How many functions of ours a check of so many goals calls, four tasks each."""
    tasks: list[Task] = []
    for n in range(goals):
        cup, before = f"cup_{n + 1}", tuple(t.task for t in tasks[-4:][:1] if n % 10)
        tasks += [
            task(f"f{n}", "fetch", f"a{n}", before, object=cup),
            task(f"w{n}", "stow", f"a{n}", (f"f{n}",), object=cup, into=f"box_{n % 20}"),
            task(f"m{n}", "mark", f"b{n}", (f"w{n}",), object=cup),
            task(f"c{n}", "seal", f"b{n}", (f"m{n}",), object=cup),
        ]
    world = house({FactKey("is_open", f"box_{n}"): True for n in range(20)}, things=goals)
    boxes = {f"box_{n}": replace(BOX, object=f"box_{n}", room=goals) for n in range(20)}
    world = changed(world, objects={**world.objects, **boxes})
    conditions = tuple(
        Condition(relation="in", subject=f"cup_{n + 1}", value=f"box_{n % 20}")
        for n in range(goals)
    )
    made = replace(plan(*tasks), conditions=conditions)
    calls = 0

    def count(frame: FrameType, event: str, _: object) -> None:
        nonlocal calls
        calls += event == "call" and "/fleet/" in frame.f_code.co_filename

    sys.setprofile(count)
    try:
        checked = check_plan(made, world)
    finally:
        sys.setprofile(None)
    assert isinstance(checked, CheckedPlan), checked.violations[:3]
    return calls


def test_a_check_costs_what_the_plan_has() -> None:
    """Four times the tasks cost about four times as much, a thousand less than a second's work."""
    few, many = calls_to_check(60), calls_to_check(250)
    assert many < 6 * few
    assert many < 1_500_000


def test_furniture_is_where_it_belongs_unless_somebody_says_otherwise() -> None:
    skills = skills_from_data(
        {
            "skills": {
                "dust": {
                    "parameters": {"robot": "robot", "thing": "contains", "place": "place"},
                    "before": ["at(thing) = place"],
                    "after": ["dusty(thing) = false"],
                }
            }
        },
        "here",
    )
    fixed = replace(BOX, movable=False, home="kitchen")
    world = home((replace(manipulator(), skills=("dust",)),))
    world = changed(world, skills=skills, objects={"box": fixed})
    here = task("t1", "dust", "a1", thing="box", place="kitchen")
    there = replace(here, args={**here.args, "place": "hallway"})
    assert not check_plan(plan(here), world).violations
    assert [v.code for v in check_plan(plan(there), world).violations] == ["condition-unmet"]
    moved = world.with_facts({FactKey("at", "box"): "hallway"})
    assert not check_plan(plan(there), moved).violations


def test_what_must_always_or_never_hold_does_in_every_order() -> None:
    inside = {FactKey("at", "cup_1"): "box", FactKey("at", "cup_2"): "box", **OPEN}
    fetch = task("t1", "fetch", "a1", object="cup_1")
    shut = task("t2", "shut", "a2", ("t1",), door="box")
    work = plan(fetch, shut)
    assert not check_plan(work, house(inside)).violations
    is_open = Condition(relation="is_open", subject="box", value=True)
    (broken,) = check_plan(replace(work, always=(is_open,)), house(inside)).violations
    assert (broken.code, broken.condition) == ("constraint-violated", is_open)
    assert broken.sentence == "is_open(box) = true must always hold, and does not after t2"
    shut_in = Condition(relation="reachable", subject="cup_2", value=False)
    (broken,) = check_plan(replace(work, never=(shut_in,)), house(inside)).violations
    assert broken.sentence == "reachable(cup_2) = false must never hold, and does after t2"
    # The first cup is out by then, whoever looks.
    other = replace(shut_in, subject="cup_1")
    assert not check_plan(replace(work, never=(other,)), house(inside)).violations
    loose = plan(replace(fetch, after=()), replace(shut, after=()))
    assert check_plan(replace(loose, never=(other,)), house(inside)).violations
    (at_once,) = check_plan(replace(work, always=(shut_in,)), house(inside)).violations
    assert (
        at_once.sentence == "reachable(cup_2) = false must always hold, and does not at the start"
    )


def test_what_comes_first_does_in_every_order() -> None:
    inside = {FactKey("at", "cup_1"): "box", FactKey("at", "cup_2"): "box", **OPEN}
    out = Condition(relation="held", subject="cup_1", value=True)
    shut_box = Condition(relation="is_open", subject="box", value=False)
    row = Precedence(first=out, then=shut_box)
    fetch = task("t1", "fetch", "a1", object="cup_1")
    shut = task("t2", "shut", "a2", ("t1",), door="box")
    work = replace(plan(fetch, shut), sometime_before=(row,))
    assert not check_plan(work, house(inside)).violations
    loose = replace(plan(fetch, replace(shut, after=())), sometime_before=(row,))
    found = check_plan(loose, house(inside)).violations
    (early,) = (each for each in found if each.code == "constraint-violated")
    assert early.condition == shut_box
    assert early.sentence == (
        "held(cup_1) = true must hold before is_open(box) = false does, and need not have after t2"
    )
    # Strictly before: not with it, and not if it holds from the start.
    same = Precedence(first=shut_box, then=shut_box)
    assert check_plan(replace(work, sometime_before=(same,)), house(inside)).violations
    is_open = Condition(relation="is_open", subject="box", value=True)
    (at_once,) = check_plan(
        replace(work, sometime_before=(Precedence(first=out, then=is_open),)), house(inside)
    ).violations
    assert at_once.sentence.endswith("and need not have at the start")
    # What held before the plan began, and not the other, came first; so did what never comes.
    for held in (Precedence(first=is_open, then=out), Precedence(first=shut_box, then=out)):
        found = check_plan(replace(work, sometime_before=(held,)), house(inside)).violations
        assert bool(found) is (held.first == shut_box)
    never = Condition(relation="at", subject="cup_2", value="hallway")
    kept = Precedence(first=shut_box, then=never)
    assert not check_plan(replace(work, sometime_before=(kept,)), house(inside)).violations
