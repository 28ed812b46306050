"""An event costs what it changes: not the size of the plan or of the fleet, not the past.

Nothing is timed. What an event takes is counted: calls of functions (Python's and C's), the
interpreter's instructions (a loop that calls nothing is work, too), and the most memory that it
held at a time (a copied table is one instruction).
"""

from __future__ import annotations

import sys
import tracemalloc
from collections.abc import Callable
from functools import cache
from types import FrameType
from typing import Any, NamedTuple

import pytest

from benchmarks.scale import errands
from benchmarks.scale.core_run import CoreRun
from fleet.core import events
from fleet.core.effects import Publish
from fleet.core.events import Event
from fleet.core.handlers.plan_results import planning_failed
from fleet.core.handlers.requests import plan_requested
from fleet.core.state import State
from fleet.core.step import step
from keyexpr_schema.facts import AT, HOLDING
from keyexpr_schema.keyspace import TASK_RECORD
from keyexpr_schema.payloads.holds import Hold, HoldKind
from keyexpr_schema.payloads.plans import PlanState
from keyexpr_schema.payloads.requests import PlanRequest
from keyexpr_schema.payloads.stops import Stop
from keyexpr_schema.payloads.tasks import ReportState
from keyexpr_schema.payloads.waits import WaitKind
from keyexpr_schema.payloads.world import Fact

FACTOR = 2.0
SLACK_BYTES = 4096
"""Memory below this much more is not told apart: a table grows by nodes, and lists by steps."""
LAST = 10_000
"""The cup of a goal that no plan has, in every size."""


class Size(NamedTuple):
    """Tasks of the running plan, robots, plans that have ended before it."""

    tasks: int
    robots: int
    ended: int


SMALLEST = Size(100, 2, 1)
SIZES = (
    Size(1000, 2, 1),
    Size(10_000, 2, 1),
    Size(100, 50, 1),
    Size(1000, 50, 100),
    Size(10_000, 50, 100),
    Size(10_000, 1000, 100),
)


class Cost(NamedTuple):
    """What one event took."""

    calls: int
    instructions: int
    bytes: int


def cost_of(state: State, event: Event) -> Cost:
    """Count what `step` does for an event. It is pure, so it is done again for each count."""

    def act() -> None:
        step(state, event)

    return Cost(calls_of(act), instructions_of(act), bytes_of(act))


def calls_of(act: Callable[[], None]) -> int:
    """Calls of functions, Python's and C's; a generator that goes on counts as called."""
    calls = 0

    def profile(frame: FrameType, event: str, argument: Any) -> None:
        nonlocal calls
        calls += event in ("call", "c_call")

    before = sys.getprofile()
    sys.setprofile(profile)
    try:
        act()
    finally:
        sys.setprofile(before)
    return calls


def instructions_of(act: Callable[[], None]) -> int:
    """Instructions of the interpreter."""
    instructions = 0

    def trace(frame: FrameType, event: str, argument: Any) -> Any:
        nonlocal instructions
        frame.f_trace_opcodes = True
        instructions += event == "opcode"
        return trace

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        act()
    finally:
        sys.settrace(before)
    return instructions


def bytes_of(act: Callable[[], None]) -> int:
    """The most memory held at a time, beyond what was held before."""
    tracemalloc.start()
    try:
        tracemalloc.reset_peak()
        before, _ = tracemalloc.get_traced_memory()
        act()
        _, most = tracemalloc.get_traced_memory()
        return most - before
    finally:
        tracemalloc.stop()


def running(size: Size) -> CoreRun:
    """A fleet with a plan that runs, a tenth of the smallest plan done."""
    run = CoreRun(size.robots)
    run.live(size.ended, first=20_000)
    run.put_cups([LAST])
    run.begin("p", range(size.tasks // errands.TASKS_A_GOAL))
    run.work(tasks=10)
    assert run.plans["p"] is PlanState.RUNNING
    return run


def next_report(run: CoreRun, skill: str, state: ReportState) -> tuple[State, Event]:
    """What has happened before a robot reports of a task by this skill, and the report."""
    while not _reports(run, run.waiting[0], skill, state):
        run.apply(run.waiting.popleft())
    return run.state, run.waiting[0]


def task_started(run: CoreRun) -> tuple[State, Event]:
    """A robot reports that it has begun what it was ordered."""
    return next_report(run, "pick", ReportState.STARTED)


def task_ended(run: CoreRun) -> tuple[State, Event]:
    """A robot reports that it is done, and gets its next order."""
    return next_report(run, "pick", ReportState.SUCCEEDED)


def goal_reached(run: CoreRun) -> tuple[State, Event]:
    """A robot reports that the last task of a goal is done, and begins with another's."""
    return next_report(run, "place", ReportState.SUCCEEDED)


def own_fact_comes_back(run: CoreRun) -> tuple[State, Event]:
    """A fact is put that is believed already: nothing changes."""
    while not isinstance(run.waiting[0], events.FactPut):
        run.apply(run.waiting.popleft())
    return run.state, run.waiting[0]


def report_said_again(run: CoreRun) -> tuple[State, Event]:
    """A report comes a second time: nothing changes."""
    _, event = task_started(run)
    run.apply(event)
    return run.state, event


def timer_fired(run: CoreRun) -> tuple[State, Event]:
    """Time has passed, and nothing is due: nothing changes."""
    return run.state, events.TimerFired(**run.at())


def fact_put(run: CoreRun) -> tuple[State, Event]:
    """A fact is put of a thing that no task is about."""
    fact = Fact(subject=f"cup_{LAST}", relation=AT, value="room_5", source="person")
    return run.state, events.FactPut(fact=fact, **run.at())


def fact_of_the_plan_put(run: CoreRun) -> tuple[State, Event]:
    """A worker says of its robot what a task of the plan needs to hold at some time."""
    order = next(iter(run.orders.values()))
    known = run.state.fact(HOLDING, order.robot)
    assert known is not None
    fact = Fact(
        subject=order.robot, relation=HOLDING, value=known.value, source=order.robot, time_s=1.0
    )
    assert fact != known
    return run.state, events.FactPut(fact=fact, **run.at())


def worker_connected(run: CoreRun) -> tuple[State, Event]:
    """A second run of a robot's worker is there."""
    return run.state, events.WorkerConnected(robot="r0", incarnation="i2", **run.at())


def worker_disconnected(run: CoreRun) -> tuple[State, Event]:
    """A robot's worker goes away; it may come back."""
    return run.state, events.WorkerDisconnected(robot="r1", incarnation="i1", **run.at())


def robot_stopped(run: CoreRun) -> tuple[State, Event]:
    """Somebody stops a robot: what is ordered of it, and ready for it, says so."""
    return run.state, events.StopPut(stop=Stop(stop="s", robots=("r1",)), **run.at())


def robot_paused(run: CoreRun) -> tuple[State, Event]:
    """Somebody pauses a robot."""
    hold = Hold(hold="h", kind=HoldKind.PAUSE, robots=("r1",))
    return run.state, events.HoldPut(hold=hold, **run.at())


def goal_put(run: CoreRun) -> tuple[State, Event]:
    """One more goal is told while the plan runs."""
    return run.state, events.GoalPut(goal=errands.goal(LAST), **run.at())


def late_report_of_an_ended_plan(run: CoreRun) -> tuple[State, Event]:
    """A worker speaks of a task of a plan that is over."""
    plan = next(plan for plan, state in run.plans.items() if state is PlanState.SUCCEEDED)
    order = next(iter(run.orders.values()))
    past = type(order)(**{f: getattr(order, f) for f in order.__struct_fields__} | {"plan": plan})
    return run.state, run.reported(past, ReportState.SUCCEEDED)


Happening = Callable[[CoreRun], tuple[State, Event]]
UNCHANGED: tuple[Happening, ...] = (
    own_fact_comes_back,
    report_said_again,
    timer_fired,
    late_report_of_an_ended_plan,
)
EVENTS: tuple[Happening, ...] = (
    *UNCHANGED,
    task_started,
    task_ended,
    goal_reached,
    fact_put,
    fact_of_the_plan_put,
    worker_connected,
    worker_disconnected,
    robot_stopped,
    robot_paused,
    goal_put,
)


def _reports(run: CoreRun, event: Event, skill: str, state: ReportState) -> bool:
    if not isinstance(event, events.ReportReceived) or event.report.state is not state:
        return False
    return run.orders[event.report.robot].skill == skill


@cache
def costs(size: Size) -> dict[str, Cost]:
    """What each of the events takes in a running plan of this size."""
    run = running(size)
    return {happens.__name__: cost_of(*happens(run)) for happens in EVENTS}


@pytest.mark.parametrize("size", SIZES, ids=lambda size: "{}-{}-{}".format(*size))
def test_an_event_of_a_running_plan_costs_the_same_in_any_size(size: Size) -> None:
    least, most = costs(SMALLEST), costs(size)
    dearer = {
        name: (least[name], most[name]) for name in least if not alike(least[name], most[name])
    }
    assert dearer == {}


@pytest.mark.parametrize("happens", UNCHANGED, ids=lambda happens: happens.__name__)
def test_an_event_that_changes_nothing_gives_back_the_same_state(happens: Happening) -> None:
    run = running(SMALLEST)
    state, event = happens(run)
    after, effects = step(state, event)
    assert after is state
    assert effects == ()


@pytest.mark.parametrize("sentence", [False, True], ids=["condition", "sentence"])
def test_one_more_goal_costs_the_same_among_ten_thousand(sentence: bool) -> None:
    goals_told(
        1, sentence
    )  # what is made once in a process, as the words of the language, is there
    few, many = goals_told(100, sentence), goals_told(10_000, sentence)
    assert alike(few, many), (few, many)


def goals_told(count: int, sentence: bool) -> Cost:
    """What the last of so many goals takes."""
    run = CoreRun(robots=2)
    run.put_cups(range(LAST - 100, LAST + 1))
    for number in range(count):
        goal = errands.goal(LAST - 1 - number % 100)
        run.receive(events.GoalPut, goal=type(goal)(
            goal=f"more-{number}", text="", conditions=goal.conditions, ordinal=number
        ))  # fmt: skip
    event = events.GoalPut(goal=errands.goal(LAST, sentence), **run.at())
    return cost_of(run.state, event)


def test_what_is_asked_and_answered_is_found_at_once_among_many_open_plans() -> None:
    assert handled_among(300) == handled_among(3)


def handled_among(plans: int) -> list[int]:
    """The calls of the handlers of a request and of answers, while so many plans are made."""
    run = CoreRun(robots=2)
    run.put_cups(range(100))
    run.put_goals(range(plans), cups=100)
    for number in range(plans):
        run.ask(errands.Errands(f"p{number}", [number], robots=2, cups=100))
    again = PlanRequest(request="ask-p1", plan="p1", goals=("g1",))
    asked = events.PlanRequested(request=again, **run.at())
    failed = events.PlanningFailed(job=10_000, reason="none", **run.at())
    return [
        calls_of(lambda: plan_requested(run.state, asked) and None),
        calls_of(lambda: planning_failed(run.state, failed) and None),
    ]


def alike(one: Cost, other: Cost) -> bool:
    """Whether neither takes more than `FACTOR` times what the other does."""
    return (
        max(one.calls, other.calls) <= FACTOR * min(one.calls, other.calls)
        and max(one.instructions, other.instructions)
        <= FACTOR * min(one.instructions, other.instructions)
        and max(one.bytes, other.bytes) <= FACTOR * min(one.bytes, other.bytes) + SLACK_BYTES
    )


def test_what_is_counted_is_seen() -> None:
    """Calls, loops that call nothing, and copies that are one instruction."""
    numbers = dict.fromkeys(range(10_000))
    assert calls_of(lambda: [len(()) for _ in range(50)] and None) >= 50
    assert instructions_of(lambda: [1 for _ in range(1000)] and None) > 1000
    assert bytes_of(lambda: {**numbers} and None) > 100_000


def test_what_waits_for_a_robot_in_other_plans_is_found_without_looking_at_their_tasks() -> None:
    """A robot ends a task, and one more plan waits for it: with many tasks as with few."""
    few, many = ended_beside(10), ended_beside(1000)
    assert alike(few, many), (few, many)


def ended_beside(goals: int) -> Cost:
    """What the end of a task takes while another plan of so many goals waits for its robot."""
    run = CoreRun(robots=1)
    run.begin("p", range(10))
    run.begin("q", range(100, 100 + goals))
    state, event = next_report(run, "pick", ReportState.SUCCEEDED)
    (first,) = state.plans["q"].index.ready["r0"]
    _, effects = step(state, event)
    told = {
        e.payload.task: e.payload
        for e in effects
        if isinstance(e, Publish) and e.key is TASK_RECORD
    }
    assert [reason.kind for reason in told[first].waits_for] == [WaitKind.BUSY]
    return cost_of(state, event)
