"""What people want of a plan while it is made again: each is met, or refused, and answered."""

from __future__ import annotations

from fleet.core import events
from fleet.core.plan_entry import PlanEntry
from fleet.core.replan_reasons import ReplanScope
from fleet.core.state import Policy
from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.payloads.plans import PlanState
from keyexpr_schema.payloads.requests import Answer, Control, ControlRequest, ReplanRequest
from keyexpr_schema.payloads.tasks import Order, ReportState, TaskState
from tests.support.fleet_model import FleetModel
from tests.support.household import bring, cup, manipulator

ROOMS = ("hallway", "living_room")


def running(robots: int = 2, cups: int = 2) -> FleetModel:
    """A plan is carried out, and from now on planning takes a while."""
    model = FleetModel(tuple(manipulator(f"r{n}") for n in range(1, robots + 1)), cups)
    model.plan(*(bring(n, ROOMS[n % 2]) for n in range(1, cups + 1)))
    model.late = True
    return model


def entry(model: FleetModel) -> PlanEntry:
    return model.plans["plan-1"]


def replan(model: FleetModel, name: str, *goals: str, why: str = "I say so") -> None:
    request = ReplanRequest(request=name, plan="plan-1", reason=why, goals=goals)
    model.receive(events.ReplanRequested, request=request)


def add_task(model: FleetModel, name: str, **more: object) -> None:
    request = ControlRequest(
        **{  # type: ignore[arg-type]
            "request": name, "control": Control.ADD_TASK, "plan": "plan-1", "skill": "navigate",
            "args": {"to": "hallway"}, **more,
        }
    )  # fmt: skip
    model.receive(events.ControlRequested, request=request)


def answer_of(model: FleetModel, name: str) -> Answer | None:
    return model.replies.get(name)


def accepted(model: FleetModel, name: str) -> bool:
    answer = answer_of(model, name)
    assert answer is not None, f"{name} was not answered"
    return answer.accepted


def new_goal(model: FleetModel, number: int, room: str = "hallway") -> str:
    model.receive(events.ObjectPut, object=cup(number))
    model.learn(f"cup_{number}", "at", "living_room")
    model.receive(events.GoalPut, goal=bring(number, room))
    return f"g{number}"


def test_goals_that_are_wanted_while_a_plan_is_made_are_in_the_next_one() -> None:
    model = running()
    replan(model, "first")
    goal = new_goal(model, 3)
    replan(model, "second", goal)
    assert entry(model).plan.goals == ("g1", "g2"), "not in the plan in work"
    assert answer_of(model, "second") is None
    model.answer()
    assert accepted(model, "first")
    assert answer_of(model, "second") is None
    model.answer()
    assert accepted(model, "second")
    model.finish()
    assert model.goal_state(goal) is GoalState.REACHED


def test_a_goal_that_a_failed_job_was_asked_for_meanwhile_is_planned_after_it() -> None:
    model = running()
    replan(model, "first")
    goal = new_goal(model, 3)
    replan(model, "second", goal)
    fail_job(model)
    assert not accepted(model, "first")
    model.finish()
    assert accepted(model, "second")
    assert model.goal_state(goal) is GoalState.REACHED


def fail_job(model: FleetModel) -> None:
    """The planner comes to nothing."""
    del model.answers[0]
    job = entry(model).job
    assert job is not None
    model.receive(events.PlanningFailed, job=job.job, reason="no way was found")


def test_a_person_who_asks_in_vain_does_not_end_the_plan() -> None:
    model = running()
    replan(model, "first")
    fail_job(model)
    answer = answer_of(model, "first")
    assert answer is not None
    assert answer.sentence == "the plan goes on as it was: no way was found"
    assert not answer.accepted
    model.finish()
    assert entry(model).state is PlanState.SUCCEEDED


def test_who_asks_the_same_thing_twice_is_answered_twice() -> None:
    model = running()
    for name in ("a", "b", "c"):
        replan(model, name)
    model.finish()
    assert all(accepted(model, name) for name in ("a", "b", "c"))
    assert entry(model).plan.revision == 3, "b and c are one new plan"


def test_a_weaker_reason_does_not_take_the_place_of_a_stronger_one() -> None:
    model = running(robots=3)
    replan(model, "first")
    replan(model, "anew")
    idle = next(r for r in ("r1", "r2", "r3") if r not in {o.robot for o in model.orders()})
    model.receive(events.WorkerConnected, robot=idle, incarnation="i2")
    model.receive(events.GoalDeleted, goal="g2")
    model.answer()
    job = entry(model).job
    assert job is not None
    assert job.reason is not None
    assert job.reason.scope is ReplanScope.ANEW
    assert len(job.takes_up) == 2
    model.finish_cancelling()
    assert accepted(model, "anew")
    assert entry(model).state is PlanState.SUCCEEDED


def test_tasks_added_while_a_plan_is_made_are_added_one_after_the_other() -> None:
    model = running()
    replan(model, "first")
    add_task(model, "one", robot="r1")
    add_task(model, "two", skill="fly")
    add_task(model, "three", robot="r2")
    model.finish()
    assert [accepted(model, name) for name in ("one", "two", "three")] == [True, False, True]
    answer = answer_of(model, "two")
    assert answer is not None
    assert "there is no skill fly" in answer.sentence
    added = [r for r in entry(model).current() if r.goal is None]
    assert [(r.robot, r.state) for r in added] == [
        ("r1", TaskState.SUCCEEDED),
        ("r2", TaskState.SUCCEEDED),
    ]


def test_a_task_that_was_added_outlives_a_plan_made_anew() -> None:
    model = running()
    model.late = False
    add_task(model, "one", args={"to": "kitchen"}, robot="r1")
    assert accepted(model, "one")
    replan(model, "anew")
    assert accepted(model, "anew")
    assert [r.args["to"] for r in entry(model).current() if r.goal is None] == ["kitchen"]
    model.finish()
    done = [r for r in model.plans["plan-1"].records.values() if r.goal is None]
    assert [r.robot for r in done if r.state is TaskState.SUCCEEDED] == ["r1"]
    replied = model.replies["one"]
    assert replied.accepted


def test_a_task_to_be_done_after_one_that_is_dropped_meanwhile_is_refused() -> None:
    model = running(robots=1)
    gone = [r.task for r in entry(model).current() if r.goal == "g2"]
    model.receive(events.GoalDeleted, goal="g2")
    add_task(model, "one", after=(gone[-1],))
    model.finish_cancelling()
    assert not accepted(model, "one")
    answer = answer_of(model, "one")
    assert answer is not None
    assert answer.sentence == f"the task was not added: {gone[-1]} is cancelled"


def test_whoever_still_wants_something_of_a_plan_that_is_cancelled_hears_of_it() -> None:
    model = running()
    replan(model, "first")
    add_task(model, "one")
    request = ControlRequest(request="stop", control=Control.CANCEL, plan="plan-1")
    model.receive(events.ControlRequested, request=request)
    assert accepted(model, "stop")
    assert not accepted(model, "first")
    assert not accepted(model, "one")
    assert model.orders()
    assert all(order.cancelled for order in model.orders())


def test_a_failed_replan_tries_again_with_the_news() -> None:
    model = running(robots=1)
    pick = next_order(model, "pick")
    model.fail(pick)
    other = {"cup_1": "cup_2", "cup_2": "cup_1"}[pick.args["object"]]
    model.learn(other, "at", "living_room")
    fail_job(model)
    assert entry(model).state is PlanState.RUNNING
    assert entry(model).job is not None
    model.finish()
    assert all(s.state is GoalState.REACHED for s in model.goal_states.values())


def next_order(model: FleetModel, skill: str) -> Order:
    while not (found := [order for order in model.orders() if order.skill == skill]):
        model.succeed(model.orders()[0])
    return found[0]


def test_a_failed_replan_without_news_gives_the_plan_up() -> None:
    model = running(robots=1)
    model.fail(next_order(model, "pick"))
    fail_job(model)
    assert entry(model).state is PlanState.FAILED


def test_a_goal_that_is_taken_back_while_the_first_plan_is_made_does_not_end_the_others() -> None:
    model = FleetModel((manipulator(),), 1)
    model.late = True
    model.plan(bring(1, "hallway"), bring(7, "hallway"))  # there is no seventh cup
    model.receive(events.GoalDeleted, goal="g7")
    model.answer()
    model.finish()
    assert model.goal_state("g1") is GoalState.REACHED
    assert accepted(model, "r0")


def test_every_goal_that_comes_up_while_plans_are_made_is_planned() -> None:
    model = running()
    model.receive(events.PlannerStarted, epoch=2, incarnation="x", policy=Policy(auto_plan=True))
    goals = [new_goal(model, number) for number in (3, 4, 5)]
    model.finish()
    assert [model.goal_state(goal) for goal in goals] == [GoalState.REACHED] * 3
    assert set(model.plans) == {"plan-1"}


def test_a_worker_that_has_been_told_to_stop_is_waited_for() -> None:
    model = running(robots=1)
    order = next_order(model, "pick")
    model.start(order)
    goal = entry(model).records[order.task].goal
    assert goal is not None
    model.receive(events.GoalDeleted, goal=goal)
    model.answer()
    assert [o.task for o in model.orders() if o.cancelled] == [order.task]
    model.report(order, ReportState.CANCELLED)
    model.finish()
    assert entry(model).state is PlanState.SUCCEEDED
