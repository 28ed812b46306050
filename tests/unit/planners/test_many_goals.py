"""Many goals and many robots: choosing costs what there is to choose from, and is checked."""

from __future__ import annotations

from collections import Counter

import pytest

from fleet.allocators.base import Allocated
from fleet.allocators.makespan import MakespanAllocator
from fleet.core.actors import carried_at_end
from fleet.core.checker.plan_checker import CheckedPlan, check_allocation
from fleet.core.model.world import WorldModel
from fleet.jobshop.time_budget import StepClock, TimeBudget
from fleet.planners.base import BIG_DAG, MONOLITHIC, PER_GOAL, PlanningProblem
from fleet.planners.plan_repair import repair_plan
from fleet.planners.symbolic import choosing
from fleet.planners.symbolic.flat_list import Team, in_one_list
from fleet.planners.symbolic.planner import SymbolicPlanner
from fleet.planners.symbolic.roles import Roles
from fleet.service.skill_models import load_all_skills
from keyexpr_schema.facts import AT, HOLDING, NOTHING, FactKey
from keyexpr_schema.payloads.goals import Condition, Goal
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.world import Fact, Object, Place

STRATEGIES = (BIG_DAG, PER_GOAL, MONOLITHIC)
HAND_SKILLS = ("navigate", "pick", "place", "place_on_robot", "pick_from_robot")


def street(
    goals: int, hands: int, carts: int, drive: float = 0.5
) -> tuple[WorldModel, tuple[Goal, ...]]:
    """A street of eight rooms; each cup is wanted half a street further on."""
    at_m = {f"room_{i}": 6.0 * i for i in range(8)}
    places = [
        Place(place=p, label=p, travel_m={q: abs(x - y) for q, y in at_m.items() if q != p})
        for p, x in at_m.items()
    ]
    cups = [
        Object(object=f"cup_{i}", kind="cup", label=f"cup {i}", ordinal=i + 1, mass_kg=0.15)
        for i in range(goals)
    ]
    able = {"drive": drive, "see": 4.0, "grip": 1.2, "reach": 1.0}
    robots = [
        RobotSpec(robot=f"hand_{i}", model="hand", skills=HAND_SKILLS, capabilities=able)
        for i in range(hands)
    ]
    carrying = {"drive": 1.0, "basket": 2.0}
    robots += [
        RobotSpec(robot=f"cart_{i}", model="cart", skills=("navigate",), capabilities=carrying)
        for i in range(carts)
    ]
    facts = [Fact(subject=s.robot, relation=AT, value="room_0", source="test") for s in robots]
    facts += [
        Fact(subject=s.robot, relation=HOLDING, value=NOTHING, source="test")
        for s in robots[:hands]
    ]
    wanted = []
    for i, cup in enumerate(cups):
        facts.append(Fact(subject=cup.object, relation=AT, value=f"room_{i % 8}", source="test"))
        condition = Condition(relation=AT, subject=cup.object, value=f"room_{(i + 4) % 8}")
        wanted.append(Goal(goal=f"g{i}", text="", ordinal=i, conditions=(condition,)))
    return WorldModel.of(load_all_skills(), places, cups, robots, facts), tuple(wanted)


def planned(
    made: tuple[WorldModel, tuple[Goal, ...]], strategy: str, budget: TimeBudget | None = None
) -> CheckedPlan:
    world, goals = made
    problem = PlanningProblem("p", goals, world, strategy=strategy)
    if budget is not None:
        problem = PlanningProblem("p", goals, world, strategy=strategy, budget=budget)
    plan = SymbolicPlanner().plan(problem)
    assert isinstance(plan, CheckedPlan), plan
    return plan


@pytest.mark.parametrize("strategy", STRATEGIES)
@pytest.mark.parametrize("drive", [0.5, 0.05])
def test_many_goals_are_planned_and_allocated(strategy: str, drive: float) -> None:
    # With slow hands a cart is the best way for each, and there are fewer carts than goals.
    made = street(20, 4, 3, drive)
    plan = planned(made, strategy)
    assert len(plan.plan.goals) == 20
    found = MakespanAllocator(exact=False, clock=StepClock()).allocate(plan)
    assert isinstance(found, Allocated), found
    order = found.schedule.extra_after
    assert check_allocation(plan.plan, made[0], found.allocation, order) == ()


def test_goals_planned_beside_others_leave_no_more_loads_than_there_are_carts() -> None:
    world, goals = street(12, 4, 2, 0.05)
    first = planned((world, goals[:6]), BIG_DAG)
    assert carried_at_end(first)
    asked = PlanningProblem("p", goals, world, first_task=1 + len(first.plan.tasks))
    made = repair_plan(first.plan, asked, SymbolicPlanner(), SymbolicPlanner(), frozenset())
    assert made is not None
    assert not made.incomplete
    assert {task.task for task in first.plan.tasks} < {task.task for task in made.plan.tasks}
    found = MakespanAllocator(exact=False, clock=StepClock()).allocate(made.checked)
    assert isinstance(found, Allocated), found


def test_a_flat_list_keeps_many_robots_busy() -> None:
    plan = planned(street(20, 4, 2), MONOLITHIC)
    hands = Counter(t.actor for t in plan.plan.tasks if t.skill == "pick")
    assert sorted(hands.values()) == [5, 5, 5, 5]


def test_a_robot_with_what_it_delivered_stays_where_it_is() -> None:
    world, goals = street(3, 2, 3)
    skills = world.skills
    sequences = [
        choosing.ActionSequence(
            goal.goal,
            tuple(
                skills[name].ground(args)
                for name, args in (
                    ("navigate", {"robot": "hand_0", "to": f"room_{i}"}),
                    ("pick", {"robot": "hand_0", "object": f"cup_{i}", "place": f"room_{i}"}),
                    ("navigate", {"robot": "cart_0", "to": f"room_{i}"}),
                    (
                        "place_on_robot",
                        {
                            "robot": "hand_0",
                            "object": f"cup_{i}",
                            "carrier": "cart_0",
                            "place": f"room_{i}",
                        },
                    ),
                    ("navigate", {"robot": "cart_0", "to": f"room_{i + 4}"}),
                )
            ),
        )
        for i, goal in enumerate(goals)
    ]
    cups = [f"cup_{i}" for i in range(3)]
    listed = in_one_list(sequences, world, Roles(world), cups, in_order=True)
    carts = [row.actions[-1].actor for row in listed]
    assert sorted(carts) == ["cart_0", "cart_1", "cart_2"]


def test_a_way_to_where_a_robot_stands_already_is_left_out_of_a_flat_list() -> None:
    world, _ = street(1, 1, 0)
    drive = world.skills["navigate"]
    there = choosing.ActionSequence("g0", (drive.ground({"robot": "hand_0", "to": "room_3"}),))
    team = Team(world, Roles(world))
    first, first_s = team.take(there)
    again, again_s = team.take(there)
    assert len(first.actions) == 1
    assert first_s > 0.0
    assert again.actions == ()
    assert again_s == 0.0


@pytest.mark.parametrize("strategy", [BIG_DAG, PER_GOAL])
def test_plans_compared_do_not_grow_with_the_goals(
    strategy: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    counts: dict[int, int] = {}
    check = choosing.check_plan

    def counted(*args: object) -> object:
        counts[goals] += 1
        return check(*args)  # type: ignore[arg-type]

    monkeypatch.setattr(choosing, "check_plan", counted)
    for goals in (20, 40):
        counts[goals] = 0
        planned(street(goals, goals // 4, goals // 8), strategy)
    most = 2 + choosing.MOST_CHANGES + 16  # the begin, changes of one, trips joined by halves
    assert max(counts.values()) <= most, counts


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_a_plan_for_what_was_found_in_time(strategy: str) -> None:
    made = street(40, 8, 4)
    steps = StepClock()
    plan = planned(made, strategy, TimeBudget(2.0, steps))
    assert 0 < len(plan.plan.goals) <= 40
    done = {(c.subject, c.value) for c in plan.plan.conditions}
    wanted = {g.conditions[0] for g in made[1] if g.goal in plan.plan.goals}
    assert {(c.subject, c.value) for c in wanted} == done
    assert FactKey(AT, "cup_0") in made[0].facts
