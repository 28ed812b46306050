"""The planner's core in the situations that matter, one event at a time."""

from __future__ import annotations

from fleet.core import events
from fleet.core.effects import Interpret, MakePlan, Publish
from fleet.core.revision.replanning import MAX_REPLANS
from fleet.core.state import Policy, State
from fleet.core.step import step
from keyexpr_schema.facts import AT, FactKey
from keyexpr_schema.keyspace import PLACE, PLAN_STATUS
from keyexpr_schema.payloads.goals import Goal, GoalState
from keyexpr_schema.payloads.plans import Plan, PlanChange, PlanState, Task
from keyexpr_schema.payloads.requests import Control, ControlRequest, ReplanRequest
from keyexpr_schema.payloads.tasks import ReportState, TaskState
from tests.support.fleet_model import FleetModel
from tests.support.household import SKILLS, at, bring, carrier, manipulator

BOTH = (bring(1, "hallway"), bring(2, "living_room"))


def fleet() -> FleetModel:
    return FleetModel((manipulator(), carrier()), cups=2)


def goal_state(model: FleetModel, goal: str) -> GoalState:
    return model.state.goal_states[goal].state


def test_a_mission_from_goals_to_reached() -> None:
    model = fleet()
    model.plan(*BOTH)
    assert {order.robot for order in model.orders()} == {"hsr", "locobot"}
    model.finish()
    assert model.state.plans["plan-1"].state is PlanState.SUCCEEDED
    assert [goal_state(model, g) for g in ("g1", "g2")] == [GoalState.REACHED] * 2
    assert model.state.answers["r0"].accepted


def test_a_goal_is_reached_as_soon_as_it_is_and_not_when_the_plan_ends() -> None:
    model = fleet()
    model.plan(*BOTH)
    while goal_state(model, "g2") is not GoalState.REACHED:
        model.succeed(model.orders()[-1])
    assert model.state.plans["plan-1"].state is PlanState.RUNNING


def test_a_failed_task_leads_to_a_new_revision_with_finished_work_kept() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    model.succeed(model.orders()[0])
    (pick,) = model.orders()
    model.fail(pick)
    entry = model.state.plans["plan-1"]
    assert entry.plan.revision == 2
    assert entry.records["t1"].state is TaskState.SUCCEEDED
    assert entry.records["t2"].state is TaskState.FAILED
    assert "it slipped" in (entry.records["t2"].reason or "")
    model.finish()
    assert goal_state(model, "g1") is GoalState.REACHED


def test_a_task_that_always_fails_ends_its_goal_with_the_reason() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    for _ in range(10 * MAX_REPLANS):
        for order in model.orders():
            if order.skill == "pick":
                model.fail(order)
            else:
                model.succeed(order)
    status = model.state.goal_states["g1"]
    assert status.state is GoalState.FAILED
    assert "it slipped" in (status.reason or "")
    assert model.orders() == []


def test_an_interrupted_attempt_that_was_done_counts_and_is_not_given_again() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    model.succeed(model.orders()[0])
    model.interrupt(model.orders()[0], done=True)
    assert model.state.plans["plan-1"].records["t2"].state is TaskState.SUCCEEDED
    assert model.orders()[0].skill == "navigate"


def test_an_interrupted_attempt_that_was_not_done_is_given_as_a_new_attempt() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    model.interrupt(model.orders()[0], done=False)
    (order,) = model.orders()
    assert (order.task, order.attempt) == ("t1", 2)


def test_reports_of_old_attempts_change_nothing_but_facts() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    (order,) = model.orders()
    model.interrupt(order, done=False)
    before = model.state.plans
    model.report(order, ReportState.FAILED, reason="late news")
    model.report(order, ReportState.SUCCEEDED)
    assert model.state.plans == before


def test_a_lost_robots_work_goes_to_another() -> None:
    model = FleetModel((manipulator("r1"), manipulator("r2")), cups=1)
    model.plan(bring(1, "hallway"))
    (order,) = model.orders()
    other = {"r1": "r2", "r2": "r1"}[order.robot]
    model.lose(order.robot)
    assert {o.robot for o in model.orders()} == {other}
    model.finish()
    assert goal_state(model, "g1") is GoalState.REACHED


def test_a_worker_that_comes_back_in_time_keeps_its_work() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    (order,) = model.orders()
    model.receive(events.WorkerDisconnected, robot="hsr", incarnation="i1")
    model.receive(events.TimerFired)
    model.receive(events.WorkerConnected, robot="hsr", incarnation="i2")
    assert model.orders() == [order]
    assert model.state.plans["plan-1"].plan.revision == 1


def test_when_nobody_is_left_goals_fail_and_say_why() -> None:
    model = FleetModel((manipulator(),), cups=1)
    model.plan(bring(1, "hallway"))
    model.lose("hsr")
    assert goal_state(model, "g1") is GoalState.FAILED
    assert "no robot is connected" in (model.state.goal_states["g1"].reason or "")


def test_a_fact_that_contradicts_the_plan_leads_to_a_new_one() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    model.learn("cup_1", "at", "living_room")
    model.succeed(model.orders()[0])
    entry = model.state.plans["plan-1"]
    assert entry.plan.revision == 2
    model.finish()
    assert goal_state(model, "g1") is GoalState.REACHED


def test_what_nobody_can_look_for_is_told() -> None:
    model = FleetModel((manipulator(),), cups=1)
    blind = manipulator().__class__(
        robot="hsr", model="hsr", skills=("navigate",), capabilities={"drive": 1.0}
    )
    model.receive(events.RobotRegistered, spec=blind)
    model.receive(events.FactDeleted, subject="cup_1", relation="at")
    model.plan(bring(1, "hallway"))
    assert not model.state.answers["r0"].accepted
    assert "where cup_1 is" in model.state.answers["r0"].sentence
    assert goal_state(model, "g1") is GoalState.WAITING
    assert model.state.plans["plan-1"].state is PlanState.REJECTED


def test_a_discovery_ends_the_search_and_leads_to_the_goal() -> None:
    model = fleet()
    model.learn("cup_1", "at", None)
    model.plan(bring(1, "hallway"))
    searching = {order.robot for order in model.orders()}
    assert searching == {"hsr", "locobot"}
    while not any(o.robot == "locobot" and o.skill == "search" for o in model.orders()):
        model.succeed(next(o for o in model.orders() if o.robot == "locobot"))
    model.learn("cup_1", "at", "living_room")
    entry = model.state.plans["plan-1"]
    assert entry.plan.revision == 2
    assert "pick" in {task.skill for task in entry.plan.tasks}
    for order in model.orders():
        if order.cancelled:
            model.report(order, ReportState.CANCELLED)
    model.finish()
    assert goal_state(model, "g1") is GoalState.REACHED


def test_what_is_found_nowhere_ends_the_goal_with_where_it_was_looked_for() -> None:
    model = fleet()
    model.learn("cup_1", "at", None)
    model.plan(bring(1, "hallway"))
    model.finish()
    assert goal_state(model, "g1") is GoalState.FAILED
    reason = model.state.goal_states["g1"].reason or ""
    assert "looked for in hallway, kitchen, living_room" in reason


def test_sentences_wait_for_the_names_they_use() -> None:
    model = FleetModel((manipulator(),), cups=1)
    model.receive(events.GoalPut, goal=Goal(goal="g", text="bring the vase to the hallway"))
    assert goal_state(model, "g") is GoalState.REJECTED
    assert "known are cup_1" in (model.state.goal_states["g"].reason or "")
    vase = events.ObjectPut(
        object=model.state.objects["cup_1"].__class__(object="vase", kind="vase", label="vase"),
        time_s=1.0,
        wall_time_s=1.0,
    )
    model.receive(events.ObjectPut, object=vase.object)
    assert goal_state(model, "g") is GoalState.WAITING


def test_a_ready_plan_waits_for_start_and_can_be_cancelled_and_deleted() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"), start=False)
    assert model.orders() == []
    assert goal_state(model, "g1") is GoalState.PLANNED

    def control(name: str, what: Control) -> bool:
        request = ControlRequest(request=name, control=what, plan="plan-1")
        model.receive(events.ControlRequested, request=request)
        return model.state.answers[name].accepted

    assert control("c1", Control.START)
    (order,) = model.orders()
    assert not control("c2", Control.DELETE)
    assert control("c3", Control.CANCEL)
    assert [o.cancelled for o in model.orders()] == [True]
    model.report(order, ReportState.CANCELLED)
    assert model.state.plans["plan-1"].state is PlanState.CANCELLED
    assert goal_state(model, "g1") is GoalState.WAITING
    assert control("c4", Control.DELETE)
    assert not [key for key in model.documents if key.startswith("plans/")]


def test_a_robot_that_is_unregistered_loses_its_work_and_gets_new_once_it_is_back() -> None:
    model = FleetModel((manipulator("r1"), manipulator("r2")), cups=2)
    model.plan(bring(1, "hallway"))
    (order,) = model.orders()
    other = {"r1": "r2", "r2": "r1"}[order.robot]
    model.receive(events.RobotUnregistered, robot=order.robot)
    assert {o.robot for o in model.orders()} == {other}
    model.finish()
    model.receive(events.RobotRegistered, spec=manipulator(order.robot))
    assert model.state.ready(order.robot)
    model.plan(bring(2, "hallway"))
    model.finish()
    assert goal_state(model, "g2") is GoalState.REACHED


def test_a_task_can_be_added_to_a_running_plan() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    request = ControlRequest(
        request="c", control=Control.ADD_TASK, plan="plan-1", skill="navigate",
        args={"to": "living_room"}, robot="locobot",
    )  # fmt: skip
    model.receive(events.ControlRequested, request=request)
    model.finish()
    entry = model.state.plans["plan-1"]
    assert entry.state is PlanState.SUCCEEDED
    assert entry.records["t5"].robot == "locobot"
    assert entry.records["t5"].state is TaskState.SUCCEEDED


def test_a_task_that_cannot_be_added_leaves_the_plan_as_it_was() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    request = ControlRequest(
        request="c", control=Control.ADD_TASK, plan="plan-1", skill="fly", args={}
    )
    model.receive(events.ControlRequested, request=request)
    model.finish()
    entry = model.state.plans["plan-1"]
    assert entry.state is PlanState.SUCCEEDED
    assert "there is no skill fly" in model.state.answers["c"].sentence
    assert not model.state.answers["c"].accepted


def test_a_plan_that_someone_proposes_is_checked_like_any_other() -> None:
    model = fleet()
    go = Task(task="t1", skill="navigate", args={"robot": "?a1", "to": "kitchen"}, actor="a1")
    good = Plan(plan="mine", goals=(), conditions=(), tasks=(go,))
    model.receive(events.PlanProposed, plan=good)
    model.finish()
    assert model.state.plans["mine"].state is PlanState.SUCCEEDED
    grab = Task(task="t1", skill="grab", args={"robot": "?a1"}, actor="a1")
    bad = Plan(plan="yours", goals=(), conditions=(), tasks=(grab,))
    model.receive(events.PlanProposed, plan=bad)
    status = model.state.plans["yours"]
    assert status.state is PlanState.REJECTED
    assert status.violations[0].code == "unknown-skill"


def test_requests_are_answered_once_and_wrong_ones_with_the_reason() -> None:
    model = fleet()
    model.plan(goals=("nothing",))
    assert "there is no goal nothing" in model.state.answers["r0"].sentence
    model.plan()
    assert "no goal that waits" in model.state.answers["r1"].sentence
    model.plan(*BOTH)
    model.plan(goals=("g1",))
    assert "already in plan plan-1" in model.state.answers["r3"].sentence
    replan = ReplanRequest(request="x", plan="nope", reason="because")
    model.receive(events.ReplanRequested, request=replan)
    assert "known are plan-1" in model.state.answers["x"].sentence
    before = model.state
    model.receive(events.ReplanRequested, request=replan)
    assert model.state is before


def test_a_replan_that_changes_nothing_disturbs_nobody() -> None:
    model = fleet()
    model.plan(*BOTH)
    before = model.orders()
    model.start(before[0])
    model.receive(
        events.ReplanRequested, request=ReplanRequest(request="x", plan="plan-1", reason="I say so")
    )
    entry = model.state.plans["plan-1"]
    assert entry.plan.revision == 2
    assert entry.change == PlanChange(kept=9, dropped=0, added=0)
    assert model.orders() == before
    model.finish()
    assert model.state.plans["plan-1"].state is PlanState.SUCCEEDED


def test_a_replan_in_the_middle_of_a_pick_goes_on_with_it() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    model.succeed(model.orders()[0])
    (pick,) = model.orders()
    model.start(pick)
    model.receive(
        events.ReplanRequested, request=ReplanRequest(request="x", plan="plan-1", reason="I say so")
    )
    assert model.orders() == [pick]
    assert model.state.plans["plan-1"].change == PlanChange(kept=3, dropped=0, added=0)
    model.finish()
    assert goal_state(model, "g1") is GoalState.REACHED


def test_work_that_is_no_longer_wanted_is_cancelled_before_what_conflicts_starts() -> None:
    model = FleetModel((manipulator("r1"), manipulator("r2")), cups=1)
    model.plan(bring(1, "hallway"))
    (order,) = model.orders()
    model.start(order)
    other = {"r1": "r2", "r2": "r1"}[order.robot]
    # The cup turns out to be in the other robot's hand: that one has to bring it.
    model.learn(other, "holding", "cup_1")
    model.learn("cup_1", "at", other)
    dropped = [o for o in model.orders() if o.cancelled]
    assert [o.task for o in dropped] == [order.task]
    assert model.state.plans["plan-1"].change is not None
    model.report(dropped[0], ReportState.CANCELLED)
    assert {o.robot for o in model.orders()} == {other}
    model.finish()
    assert goal_state(model, "g1") is GoalState.REACHED


def test_a_goal_that_comes_up_joins_the_running_plan_when_asked() -> None:
    model = fleet()
    model.plan(BOTH[0])
    model.receive(events.GoalPut, goal=BOTH[1])
    model.receive(
        events.ReplanRequested,
        request=ReplanRequest(request="x", plan="plan-1", reason="more", goals=("g2",)),
    )
    assert model.state.plans["plan-1"].plan.goals == ("g1", "g2")
    model.finish()
    assert goal_state(model, "g2") is GoalState.REACHED


def test_goals_are_planned_unasked_where_the_policy_says_so() -> None:
    model = fleet()
    model.receive(events.PlannerStarted, epoch=2, incarnation="x", policy=Policy(auto_plan=True))
    for goal in BOTH:
        model.receive(events.GoalPut, goal=goal)
    assert list(model.state.plans) == ["plan-1"]
    model.finish()
    assert [goal_state(model, g) for g in ("g1", "g2")] == [GoalState.REACHED] * 2


def test_a_new_robot_is_given_a_share() -> None:
    model = FleetModel((manipulator("r1"),), cups=2)
    model.plan(*BOTH)
    model.receive(events.RobotRegistered, spec=manipulator("r2"))
    model.receive(events.WorkerConnected, robot="r2", incarnation="i1")
    model.learn("r2", "holding", "nothing")
    entry = model.state.plans["plan-1"]
    assert entry.plan.revision == 2
    assert {record.robot for record in entry.current()} == {"r1", "r2"}
    model.finish()
    assert entry.plan.goals == ("g1", "g2")
    assert model.state.plans["plan-1"].state is PlanState.SUCCEEDED


def test_a_plan_waits_for_approval_where_the_policy_says_so() -> None:
    model = fleet()
    model.receive(events.PlannerStarted, epoch=2, incarnation="x", policy=Policy(approval=True))
    model.plan(bring(1, "hallway"))
    assert model.state.plans["plan-1"].state is PlanState.PROPOSED
    assert model.orders() == []
    approve = ControlRequest(request="a", control=Control.APPROVE, plan="plan-1")
    model.receive(events.ControlRequested, request=approve)
    model.finish()
    assert goal_state(model, "g1") is GoalState.REACHED


def test_a_dry_run_shows_the_plan_and_leaves_nothing_behind() -> None:
    model = fleet()
    model.plan(*BOTH, dry_run=True)
    answer = model.state.answers["r0"]
    assert answer.preview is not None
    assert len(answer.preview.tasks) == 9
    assert answer.preview_status is not None
    assert set(answer.preview_status.allocation.values()) == {"hsr", "locobot"}
    assert model.state.plans == {}
    assert model.state.previews == {}
    assert goal_state(model, "g1") is GoalState.WAITING


def test_a_goal_in_steps_takes_one_after_the_other() -> None:
    model = fleet()
    model.receive(events.PlannerStarted, epoch=2, incarnation="x", policy=Policy(interpreter=True))
    model.receive(events.GoalPut, goal=Goal(goal="g", text="kindly do the usual with cup one"))
    assert goal_state(model, "g") is GoalState.READING
    model.plan(goals=("g",))
    assert "still being worked out" in model.state.answers["r0"].sentence
    assert any(isinstance(effect, Interpret) for effect in model.effects)
    stages = ((at("cup_1", "hallway"),), (at("cup_1", "living_room"),))
    model.receive(events.GoalInterpreted, goal="g", stages=stages)
    model.plan()
    model.finish()
    assert goal_state(model, "g") is GoalState.REACHED
    assert model.state.facts[FactKey(AT, "cup_1")].value == "living_room"
    places = [
        record.args["place"]
        for record in model.state.plans["plan-1"].records.values()
        if record.skill == "place"
    ]
    assert places == ["hallway", "living_room"]


def test_what_an_earlier_step_brought_somewhere_stays_there() -> None:
    model = FleetModel((manipulator(), manipulator("r2"), carrier()), cups=2)
    text = "Bring both cups to the living room, then send the locobot to the kitchen."
    model.plan(Goal(goal="g", text=text))
    model.finish()
    assert goal_state(model, "g") is GoalState.REACHED
    assert {str(c) for c in model.state.goal_states["g"].conditions} == {
        "at(locobot) = kitchen",
        "at(cup_1) = living_room",
        "at(cup_2) = living_room",
    }


def test_a_sentence_that_no_model_understands_is_refused() -> None:
    model = fleet()
    model.receive(events.PlannerStarted, epoch=2, incarnation="x", policy=Policy(interpreter=True))
    model.receive(events.GoalPut, goal=Goal(goal="g", text="hum a tune"))
    model.receive(events.GoalInterpreted, goal="g", reason="it is no task for robots")
    assert goal_state(model, "g") is GoalState.REJECTED
    assert "no task for robots" in (model.state.goal_states["g"].reason or "")


def test_a_deleted_goal_leaves_the_plan() -> None:
    model = fleet()
    model.plan(*BOTH)
    model.receive(events.GoalDeleted, goal="g2")
    model.finish()
    entry = model.state.plans["plan-1"]
    assert entry.state is PlanState.SUCCEEDED
    assert entry.plan.goals == ("g1",)
    assert "goals/g2/status" not in model.documents


def test_a_crash_of_the_planner_changes_nothing_but_the_epoch_of_orders() -> None:
    model = fleet()
    model.plan(*BOTH)
    before = model.orders()
    model.crash()
    after = model.orders()
    assert [(o.task, o.attempt) for o in before] == [(o.task, o.attempt) for o in after]
    assert {order.epoch for order in after} == {2}
    model.finish()
    assert model.state.plans["plan-1"].state is PlanState.SUCCEEDED


def test_a_planner_without_a_journal_does_nothing_a_second_time() -> None:
    model = fleet()
    model.plan(*BOTH)
    model.finish()
    fresh = State()
    remembered = events.PriorStateLoaded(
        time_s=0.0, wall_time_s=0.0,
        answers=tuple(model.state.answers.values()),
        goals=tuple(model.state.goal_states.values()),
        plans=("plan-1",),
    )  # fmt: skip
    fresh, _ = step(fresh, remembered, SKILLS)
    for line in model.journal:
        event = events.decode_event(line)
        if isinstance(event, events.PlanRequested | events.GoalPut):
            fresh, effects = step(fresh, event, SKILLS)
            assert not any(isinstance(effect, MakePlan) for effect in effects)
    proposed = events.PlanProposed(
        plan=model.state.plans["plan-1"].plan, time_s=0.0, wall_time_s=0.0
    )
    fresh, effects = step(fresh, proposed, SKILLS)
    assert effects == ()
    assert fresh.goal_states["g1"].state is GoalState.REACHED


def test_an_event_without_meaning_changes_nothing() -> None:
    model = fleet()
    state, effects = step(
        model.state, events.GoalDeleted(goal="x", time_s=1e9, wall_time_s=1e12), SKILLS
    )
    assert state is model.state
    assert effects == ()


def test_only_documents_of_the_planner_are_published() -> None:
    model = fleet()
    model.plan(*BOTH)
    model.finish()
    kinds = {effect.key.name for effect in model.effects if isinstance(effect, Publish)}
    assert PLAN_STATUS.name in kinds
    assert PLACE.name not in kinds
