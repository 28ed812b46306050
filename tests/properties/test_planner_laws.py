"""Laws of the planner's core under any order of events: crashes, failures, losses, repetitions.

The model checks on every order that its dependencies are done, that no robot is in two places and
that an attempt never changes hands; on every crash that the journal replays to the same state.
"""

from __future__ import annotations

from collections import Counter

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)

from fleet.core import events
from keyexpr_schema.payloads.closures import Closure
from keyexpr_schema.payloads.goals import ENDED_GOALS, Condition, Goal, GoalState, GoalStatus
from keyexpr_schema.payloads.holds import Hold, HoldKind
from keyexpr_schema.payloads.plans import ENDED_PLANS, PlanState
from keyexpr_schema.payloads.requests import Control, ControlRequest, ReplanRequest
from keyexpr_schema.payloads.stops import Stop
from keyexpr_schema.payloads.tasks import ENDED_TASKS, ReportState, TaskState
from tests.support.fleet_model import FleetModel
from tests.support.household import bring, carrier, manipulator

PICK = st.integers(0, 10)
MOST_GOALS = 4
UNDONE = (PlanState.REJECTED, PlanState.CANCELLED)
"""Plans whose goals wait for another one."""


def _about(status: GoalStatus) -> set[str]:
    return {name for condition in status.conditions for name in condition.subjects}


class Undisturbed(RuleBasedStateMachine):
    """Robots do what they are told; people, crashes and the clock come in between."""

    reaches_everything = True
    late = False
    programs = False
    met: Counter[str] = Counter()

    @initialize(
        second=st.booleans(),
        together=st.sampled_from([False, True]),
        cups=st.sampled_from([3, 2, 1]),
        rooms=st.lists(st.sampled_from(["hallway", "living_room"]), min_size=3, max_size=3),
        first=st.sampled_from([1, 2, 0]),
    )
    def begin(self, second: bool, together: bool, cups: int, rooms: list[str], first: int) -> None:
        robots = (manipulator(), carrier(), *((manipulator("r2"),) if second else ()))
        self.model = FleetModel(robots, cups, self.late)
        self.away: set[str] = set()
        self.a_plan_was_cancelled = False
        self.finished: set[tuple[str, str]] = set()
        self.to_be_kept: set[str] = set()
        """Things in a hand that are not to be put down."""
        self.asked: dict[str, tuple[str, ...]] = {}
        """Requests, and goals that they want taken in."""
        goals = [bring(n, rooms[n - 1]) for n in range(1, cups + 1)]
        for share in [goals] if together else [[goal] for goal in goals]:
            self.model.plan(*share, programs=self.programs)
        if first and self.model.answers:
            self.model.answer(first)

    def order(self, pick: int):  # type: ignore[no-untyped-def]
        orders = self.model.orders()
        return orders[pick % len(orders)]

    @precondition(lambda self: self.model.orders())
    @rule(pick=PICK)
    def succeed(self, pick: int) -> None:
        self.model.succeed(self.order(pick))

    @precondition(lambda self: self.model.orders())
    @rule(pick=PICK)
    def start(self, pick: int) -> None:
        self.model.start(self.order(pick))

    @precondition(lambda self: self.model.reports)
    @rule(pick=PICK)
    def an_old_report_comes_again(self, pick: int) -> None:
        report = self.model.reports[pick % len(self.model.reports)]
        self.model.receive(events.ReportReceived, report=report)

    @precondition(lambda self: self.model.answers)
    @rule(pick=PICK)
    def a_job_is_answered(self, pick: int) -> None:
        self.model.answer(pick)

    @precondition(lambda self: self.model.given_answers)
    @rule(pick=PICK)
    def an_answer_comes_again(self, pick: int) -> None:
        self.model.answer_again(pick)

    @precondition(lambda self: any(order.cancelled for order in self.model.orders()))
    @rule()
    def what_is_cancelled_is_confirmed(self) -> None:
        order = next(order for order in self.model.orders() if order.cancelled)
        self.model.report(order, ReportState.CANCELLED)

    @rule()
    def a_person_wants_another_plan(self) -> None:
        request = ReplanRequest(
            request=f"again-{len(self.model.journal)}", plan="plan-1", reason="because"
        )
        self.asked[request.request] = ()
        self.model.receive(events.ReplanRequested, request=request)

    @rule(robot=st.sampled_from(["hsr", "locobot", None]), after=st.booleans())
    def a_person_wants_one_more_task(self, robot: str | None, after: bool) -> None:
        entry = self.model.plans.get("plan-1")
        request = ControlRequest(
            request=f"task-{len(self.model.journal)}",
            control=Control.ADD_TASK,
            plan="plan-1",
            skill="navigate",
            args={"to": "kitchen"},
            after=tuple(entry.records)[-1:] if entry is not None and after else (),
            robot=robot,
        )
        self.asked[request.request] = ()
        self.model.receive(events.ControlRequested, request=request)

    @precondition(lambda self: self.model.state.plans)
    @rule(pick=PICK)
    def somebody_does_a_task_by_hand(self, pick: int) -> None:
        """Whatever it is, and whether or not its turn has come."""
        plans = self.model.state.plans
        plan, entry = sorted(plans.items())[pick % len(plans)]
        undone = [r.task for r in entry.records.values() if r.state not in ENDED_TASKS]
        if undone:
            request = ControlRequest(
                request=f"done-{len(self.model.journal)}",
                control=Control.TASK_DONE,
                plan=plan,
                task=undone[pick % len(undone)],
            )
            self.asked[request.request] = ()
            self.model.receive(events.ControlRequested, request=request)

    @precondition(lambda self: self.programs)
    @rule(
        robot=st.sampled_from(["hsr", "locobot", None]),
        text=st.sampled_from(["search the hallway", "look around in every room"]),
    )
    def a_person_says_a_sentence(self, robot: str | None, text: str) -> None:
        request = ControlRequest(
            request=f"say-{len(self.model.journal)}",
            control=Control.ADD_TASK,
            plan="plan-1",
            skill="do",
            args={"text": text},
            robot=robot,
        )
        self.asked[request.request] = ()
        self.model.receive(events.ControlRequested, request=request)

    @rule(plan=st.sampled_from(["plan-1", "plan-2", "plan-3"]))
    def a_person_cancels_a_plan_that_is_being_made(self, plan: str) -> None:
        entry = self.model.plans.get(plan)
        if entry is not None and entry.job is not None:
            number = len(self.model.replies)
            request = ControlRequest(request=f"stop-{number}", control=Control.CANCEL, plan=plan)
            self.model.receive(events.ControlRequested, request=request)
            self.a_plan_was_cancelled = True

    @rule()
    def a_plan_for_what_waits_is_asked_for(self) -> None:
        self.model.plan()

    @precondition(lambda self: self.model.orders())
    @rule(pick=PICK)
    def a_worker_crashes_at_the_end_of_its_work(self, pick: int) -> None:
        self.model.interrupt(self.order(pick), done=True)

    @rule(robots=st.sampled_from([(), ("hsr",), ("locobot", "r2")]))
    def somebody_stops_robots(self, robots: tuple[str, ...]) -> None:
        """What they do is interrupted, and reported when they are free again."""
        stop = Stop(stop=f"s{len(self.model.journal)}", robots=robots)
        self.model.receive(events.StopPut, stop=stop)

    @rule(
        kind=st.sampled_from(HoldKind),
        robots=st.sampled_from([("hsr",), ("locobot", "r2"), ()]),
        plans=st.sampled_from([("plan-1",), ()]),
        interrupt=st.booleans(),
    )
    def somebody_holds_something(
        self, kind: HoldKind, robots: tuple[str, ...], plans: tuple[str, ...], interrupt: bool
    ) -> None:
        name, pause = f"h{len(self.model.journal)}", kind is HoldKind.PAUSE
        what = {"plans": plans, "interrupt": interrupt} if pause else {}
        hold = Hold(hold=name, kind=kind, robots=robots, **what)  # type: ignore[arg-type]
        self.model.receive(events.HoldPut, hold=hold)

    @precondition(lambda self: self.model.state.holds)
    @rule(pick=PICK)
    def a_hold_ends(self, pick: int) -> None:
        holds = sorted(self.model.state.holds)
        self.model.receive(events.HoldDeleted, hold=holds[pick % len(holds)])

    @rule(
        place=st.sampled_from(["kitchen", "hallway", "living_room"]),
        models=st.sampled_from([(), ("hsr",)]),
        for_s=st.sampled_from([None, 20.0]),
    )
    def somebody_closes_a_place(
        self, place: str, models: tuple[str, ...], for_s: float | None
    ) -> None:
        until_s = None if for_s is None else self.model.time_s + for_s
        name = f"c{len(self.model.journal)}"
        closure = Closure(closure=name, names=(place,), models=models, until_s=until_s)
        self.model.receive(events.ClosurePut, closure=closure)

    @precondition(lambda self: self.model.state.closures)
    @rule(pick=PICK)
    def a_place_is_opened(self, pick: int) -> None:
        closures = sorted(self.model.state.closures)
        self.model.receive(events.ClosureDeleted, closure=closures[pick % len(closures)])

    @precondition(lambda self: self.model.state.stops)
    @rule(pick=PICK)
    def a_stop_is_lifted(self, pick: int) -> None:
        stops = sorted(self.model.state.stops)
        self.lift(stops[pick % len(stops)])

    def lift(self, name: str) -> None:
        held = [order for order in self.model.orders() if self.model.state.stopped(order.robot)]
        self.model.receive(events.StopDeleted, stop=name)
        for order in held:
            if not self.model.state.stopped(order.robot) and order in self.model.orders():
                self.model.interrupt(order, done=False, stops=(name,))

    @precondition(lambda self: len(self.model.state.goals) < MOST_GOALS)
    @rule(room=st.sampled_from(["kitchen", "hallway", "living_room"]))
    def a_goal_comes_up_in_the_middle(self, room: str) -> None:
        number = len(self.model.journal)
        wanted = Condition(relation="searched", subject=room, value=True)
        goal = Goal(goal=f"look-{number}", text="", conditions=(wanted,), ordinal=100 + number)
        self.model.receive(events.GoalPut, goal=goal)
        request = ReplanRequest(
            request=f"more-{number}", plan="plan-1", reason="more", goals=(goal.goal,)
        )
        self.asked[request.request] = (goal.goal,)
        self.model.receive(events.ReplanRequested, request=request)

    @precondition(lambda self: len(self.model.state.goals) > 1)
    @rule(pick=PICK)
    def a_goal_is_deleted(self, pick: int) -> None:
        goals = sorted(self.model.state.goals)
        goal = goals[pick % len(goals)]
        status = self.model.state.goal_states[goal]
        if status.own:  # who takes a put-down back wants the thing to stay where it is
            self.to_be_kept |= _about(status)
        self.model.receive(events.GoalDeleted, goal=goal)

    @rule()
    def the_planner_crashes(self) -> None:
        self.model.crash()

    @rule(seconds=st.sampled_from([20.0, 120.0, 2000.0]))
    def time_passes(self, seconds: float) -> None:
        self.model.time_s += seconds
        self.model.receive(events.TimerFired)

    def teardown(self) -> None:
        if not hasattr(self, "model"):
            return
        for robot in sorted(self.away):
            self.model.return_(robot)
        for stop in sorted(self.model.state.stops):
            self.lift(stop)
        for hold in sorted(self.model.state.holds):
            self.model.receive(events.HoldDeleted, hold=hold)
        for closure in sorted(self.model.state.closures):
            self.model.receive(events.ClosureDeleted, closure=closure)
        self.model.finish()
        self.met.update(self.model.met)
        plans = self.model.plans
        for entry in plans.values():
            assert entry.state in ENDED_PLANS, f"{entry.plan.plan} is {entry.state}: it never ends"
            assert not entry.outstanding()
        if self.reaches_everything and not self.a_plan_was_cancelled:
            about = {name for s in self.model.state.goal_states.values() for name in _about(s)}
            held = {self.model.state.fact("holding", r) for r in self.model.state.robots}
            left = {fact.value for fact in held if fact is not None} - about - {"nothing"}
            left -= self.to_be_kept
            assert not left, f"{left} stays in a hand, and nobody wants it"
        for request in self.asked:
            assert request in self.model.replies, f"{request} was never answered"
        met = [
            goals for request, goals in self.asked.items() if self.model.replies[request].accepted
        ]
        promised = {goal for goals in met for goal in goals}
        for goal, status in self.model.goal_states.items():
            assert (
                goal not in promised
                or self.a_plan_was_cancelled
                or any(goal in entry.plan.goals for entry in plans.values())
            ), f"{goal} was asked for while a plan was being made, and is in none"
            waits = all(
                goal not in entry.plan.goals or entry.state in UNDONE for entry in plans.values()
            )
            assert status.state in ENDED_GOALS or waits, f"{goal} is {status.state} for ever"
            if self.reaches_everything and not waits:
                assert status.state is GoalState.REACHED, (
                    f"{goal} is {status.state}: {status.reason}"
                )

    @invariant()
    def finished_work_stays_finished(self) -> None:
        if not hasattr(self, "model"):
            return
        for plan, entry in self.model.plans.items():
            for record in entry.records.values():
                if (plan, record.task) in self.finished:
                    assert record.state is TaskState.SUCCEEDED, "finished work was undone"
                elif record.state is TaskState.SUCCEEDED:
                    self.finished.add((plan, record.task))


class Disturbed(Undisturbed):
    """And things go wrong."""

    reaches_everything = False

    @precondition(lambda self: self.model.orders())
    @rule(pick=PICK)
    def fail(self, pick: int) -> None:
        self.model.fail(self.order(pick))

    @precondition(lambda self: self.model.orders())
    @rule(pick=PICK, done=st.booleans())
    def interrupt(self, pick: int, done: bool) -> None:
        self.model.interrupt(self.order(pick), done)

    @rule(robot=st.sampled_from(["hsr", "locobot", "r2"]))
    def a_robot_is_lost(self, robot: str) -> None:
        if robot in self.model.state.robots and robot not in self.away:
            self.away.add(robot)
            self.model.lose(robot)

    @rule()
    def robots_return(self) -> None:
        for robot in sorted(self.away):
            self.model.return_(robot)
        self.away.clear()

    @rule(cup=st.integers(1, 3), room=st.sampled_from(["kitchen", "hallway", None]))
    def a_person_moves_a_cup(self, cup: int, room: str | None) -> None:
        self.model.learn(f"cup_{cup}", "at", room)


@pytest.mark.parametrize(("machine", "examples"), [(Undisturbed, 25), (Disturbed, 45)])
def test_the_laws_hold_whatever_comes(machine: type[Undisturbed], examples: int) -> None:
    how = settings(max_examples=examples, stateful_step_count=25, deadline=None)
    run_state_machine_as_test(machine, settings=how)


@pytest.mark.parametrize(("machine", "examples"), [(Undisturbed, 15), (Disturbed, 25)])
def test_the_laws_hold_where_plans_are_carried_out_as_programs(
    machine: type[Undisturbed], examples: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    met: Counter[str] = Counter()
    monkeypatch.setattr(machine, "met", met)
    monkeypatch.setattr(machine, "programs", True)
    how = settings(max_examples=examples, stateful_step_count=25, deadline=None)
    run_state_machine_as_test(machine, settings=how)
    assert met["programs"]


def late_in_every_way(life: Undisturbed) -> None:
    """One life in which answers come in every way that matters: random ones may miss some."""
    life.begin(second=False, together=False, cups=3, rooms=["hallway"] * 3, first=1)
    life.an_answer_comes_again(0)
    life.a_job_is_answered(0)
    life.a_person_wants_another_plan()
    life.a_person_wants_another_plan()
    life.a_person_cancels_a_plan_that_is_being_made("plan-3")
    while life.model.answers:
        life.a_job_is_answered(0)
        life.finished_work_stays_finished()
    life.teardown()


@pytest.mark.parametrize(("machine", "examples"), [(Undisturbed, 30), (Disturbed, 40)])
def test_the_laws_hold_when_planning_jobs_are_answered_late_and_in_any_order(
    machine: type[Undisturbed], examples: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    met: Counter[str] = Counter()
    monkeypatch.setattr(machine, "met", met)
    monkeypatch.setattr(machine, "late", True)
    late_in_every_way(machine())
    how = settings(max_examples=examples, stateful_step_count=25, deadline=None)
    run_state_machine_as_test(machine, settings=how)
    ways = ("in another order", "a second time", "superseded", "another reason meanwhile")
    assert all(met[way] for way in ways), met
