"""Programs written with no network: what they say, and that as actions they are what they do."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from fleet.core.checker.plan_checker import CheckedPlan, check_plan
from fleet.core.model.programs import program_model
from fleet.core.model.world import WorldModel
from fleet.jobshop.time_budget import TimeBudget
from fleet.planners import NoPlan, PlanningProblem, SymbolicPlanner
from fleet.planners.programs.joining import joined
from fleet.planners.programs.writer import write_program
from keyexpr_schema.facts import Literal
from keyexpr_schema.payloads.goals import Condition
from keyexpr_schema.payloads.plans import Plan, Task
from keyexpr_schema.payloads.programs import Program
from tests.support.household import at, bring, checked, fact, home


def program(world: WorldModel, *wanted: Condition, robot: str = "hsr") -> Program | NoPlan:
    asked = Program(text="a sentence", stages=(wanted,))
    return write_program(asked, world, robot, SymbolicPlanner(), TimeBudget(30.0))


def test_a_thing_whose_place_is_known_is_fetched_with_a_check_and_a_second_look() -> None:
    made = program(home(), at("cup_1", "hallway"))
    assert isinstance(made, Program)
    assert (
        made.code
        == """\
# a sentence
navigate(to="kitchen")
if ask("at", "cup_1") is None:
    replan("nobody knows where cup_1 is now")
try:
    pick(object="cup_1", place="kitchen")
except RuntimeError:
    search(place="kitchen")
    pick(object="cup_1", place="kitchen")
navigate(to="hallway")
place(object="cup_1", place="hallway")
"""
    )


def test_the_same_with_several_things_is_a_loop() -> None:
    made = program(home(cups=3), *(at(f"cup_{n}", "hallway") for n in (1, 2, 3)))
    assert isinstance(made, Program)
    assert 'for name_1 in ("cup_1", "cup_2", "cup_3"):\n    navigate(to="kitchen")' in made.code
    assert made.code.count("place(object=name_1") == 1


def test_what_is_lost_is_looked_for_and_brought_from_wherever_it_was_found() -> None:
    made = program(home(facts=(fact("cup_1", "at", None),)), at("cup_1", "hallway"))
    assert isinstance(made, Program)
    assert made.code.startswith("""\
# a sentence
for name_1 in ("kitchen", "hallway", "living_room"):
    if ask("at", "cup_1") is None:
        navigate(to=name_1)
        search(place=name_1)
found = ask("at", "cup_1")
if found is None:
    fail("cup_1 is not to be found")
""")
    for room in ("kitchen", "living_room"):
        assert f'elif found in ("{room}",):\n    navigate(to="{room}")' in made.code
    assert 'elif found in ("hallway",):\n    pass\n' in made.code
    assert made.code.endswith('else:\n    replan(f"cup_1 is at {found}")\n')


def test_a_robot_that_cannot_do_it_gets_no_program() -> None:
    made = program(home(), at("cup_1", "hallway"), robot="locobot")
    assert isinstance(made, NoPlan) and "locobot does not have the skill" in made.reason


def test_a_program_as_an_action_needs_and_makes_what_its_calls_do_together() -> None:
    world = home()
    made = program(world, at("cup_1", "hallway"))
    assert isinstance(made, Program)
    model = program_model(made, world.skills)
    assert model is not None and set(model.uses) == {"navigate", "pick", "place"}
    before = {str(row) for row in model.before}
    assert {"at(cup_1) = kitchen", "holding(robot) = nothing"} <= before
    assert "at(robot) = kitchen" not in before and "holding(robot) = cup_1" not in before
    after: set[Literal] = set(model.after)
    assert {str(row) for row in after} == {
        "at(robot) = hallway",
        "holding(robot) = nothing",
        "at(cup_1) = hallway",
    }
    assert made.duration_s > 50.0


@pytest.mark.parametrize("cups", [1, 2, 3])
def test_a_plan_with_programs_is_as_valid_and_orders_less(cups: int) -> None:
    world = home(cups=cups)
    goals = tuple(bring(n, "hallway") for n in range(1, cups + 1))
    plain = SymbolicPlanner().plan(PlanningProblem(plan="p", goals=goals, world=world))
    assert isinstance(plain, CheckedPlan)
    made = joined(plain)
    assert isinstance(check_plan(made.plan, world), CheckedPlan)
    assert len(made.plan.tasks) < len(plain.plan.tasks)
    steps = [(s.skill) for t in made.plan.tasks for s in (t.program.steps if t.program else ())]
    steps += [task.skill for task in made.plan.tasks if task.program is None]
    assert sorted(steps) == sorted(task.skill for task in plain.plan.tasks)
    assert {task.goal for task in made.plan.tasks} == {task.goal for task in plain.plan.tasks}


def test_calls_that_others_wait_for_are_not_joined_with_what_comes_after() -> None:
    """Two robots that hand something over: nobody drives off before, and nobody waits too long."""
    world = home(cups=2)
    goals = (bring(1, "hallway"), bring(2, "living_room"))
    plain = SymbolicPlanner().plan(PlanningProblem(plan="p", goals=goals, world=world))
    assert isinstance(plain, CheckedPlan)
    if any(task.skill == "place_on_robot" for task in plain.plan.tasks):
        made = joined(plain)
        (handed,) = [task for task in made.plan.tasks if task.skill == "place_on_robot"]
        assert handed.program is None and len(handed.after) == 2
    else:
        pytest.fail("the plan hands nothing over any more: choose another world")


def test_a_program_that_a_person_wrote_stands_in_a_plan_and_is_checked() -> None:
    code = 'for room in ("kitchen", "hallway"):\n    search(place=room)\n'
    after = (Condition(relation="searched", subject="kitchen", value=True),)
    program_ = Program(text="look around", code=code, after=after)
    args = {"robot": "?a1", "text": "look around"}
    task = Task(task="t1", skill="do", args=args, actor="a1", program=program_)
    plan = Plan(plan="p", goals=(), conditions=after, tasks=(task,))
    found = checked(plan, home())
    assert set(found.able["a1"]) == {"hsr", "locobot"}
    picks = replace(program_, code='pick(object="cup_1", place="kitchen")')
    found = checked(replace(plan, tasks=(replace(task, program=picks),)), home())
    assert found.able["a1"] == ("hsr",)
    unwritten = replace(plan, tasks=(replace(task, program=replace(program_, code="")),))
    refused = check_plan(unwritten, home())
    assert refused.violations[0].code == "no-program"
