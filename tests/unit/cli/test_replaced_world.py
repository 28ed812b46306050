"""What leaves with `world load --replace`, and what stands in its way."""

from __future__ import annotations

from cli.client.fleet_view import FleetView
from cli.plans.replaced_world import in_use, leaving
from keyexpr_schema.facts import AT, HOLDING, FactKey
from keyexpr_schema.payloads.goals import Condition, GoalState, GoalStatus
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.tasks import TaskRecord, TaskState
from keyexpr_schema.payloads.world import Fact


def fact(relation: str, subject: str, value: str) -> tuple[FactKey, Fact]:
    told = Fact(subject=subject, relation=relation, value=value, source="person", time_s=0.0)
    return told.key, told


def record(task: str, state: TaskState, **args: str) -> TaskRecord:
    return TaskRecord(
        plan="p",
        revision=1,
        task=task,
        skill="pick",
        args=args,
        actor="a1",
        robot="hsr",
        state=state,
    )


def fleet() -> FleetView:
    return FleetView(
        robot_specs={"hsr": RobotSpec(robot="hsr", model="hsr", skills=(), capabilities={})},
        facts=dict(
            [
                fact(AT, "cup_1", "pantry"),
                fact(AT, "cup_2", "kitchen"),
                fact(AT, "plate", "cup_1"),
                fact(AT, "hsr", "pantry"),
                fact(HOLDING, "hsr", "nothing"),
            ]
        ),
    )


def test_facts_of_what_leaves_and_at_it_leave_but_not_what_a_robot_says_of_itself() -> None:
    places, objects = ["kitchen", "pantry"], ["cup_1", "cup_2", "plate"]
    leaves = leaving(fleet(), places, objects, ["kitchen", "hall"], ["cup_2", "plate"])
    assert (leaves.places, leaves.objects) == (("pantry",), ("cup_1",))
    assert set(leaves.facts) == {FactKey(AT, "cup_1"), FactKey(AT, "plate")}


def test_what_changes_its_kind_keeps_its_facts() -> None:
    """A trolley that was a place is a thing now: the name still stands for something."""
    leaves = leaving(fleet(), ["kitchen", "pantry"], [], ["kitchen"], ["pantry"])
    assert (leaves.places, leaves.facts) == (("pantry",), ())


def test_what_is_under_way_with_it_is_named() -> None:
    view = fleet()
    view.tasks = {
        ("p", "t1"): record("t1", TaskState.RUNNING, object="cup_1", place="kitchen"),
        ("p", "t2"): record("t2", TaskState.SUCCEEDED, object="cup_1"),
        ("p", "t3"): record("t3", TaskState.WAITING, object="cup_2"),
    }
    wanted = Condition(relation=AT, subject="cup_2", value="pantry")
    view.goal_status = {
        "g1": GoalStatus(goal="g1", state=GoalState.PLANNED, conditions=(wanted,)),
        "g2": GoalStatus(goal="g2", state=GoalState.REACHED, conditions=(wanted,)),
        "g3": GoalStatus(goal="g3", state=GoalState.STANDING, stages=((wanted,),)),
    }
    leaves = leaving(view, ["kitchen", "pantry"], ["cup_1", "cup_2"], ["kitchen"], ["cup_2"])
    assert in_use(view, leaves) == [
        "task p/t1 (pick) is running with cup_1",
        "goal g1 (planned) is about pantry",
        "goal g3 (standing) is about pantry",
        "robot hsr is at pantry",
    ]
    assert in_use(view, leaving(view, ["kitchen"], ["cup_2"], ["kitchen"], ["cup_2"])) == []
