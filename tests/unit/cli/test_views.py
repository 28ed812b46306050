"""What robotctl draws."""

from __future__ import annotations

import io
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace
from rich.console import RenderableType

from cli.commands.processes import parse_speed
from cli.commands.tasks import parse_args
from cli.errors import BadArgument, Unknown, check_known
from cli.overview.situation import Filters
from cli.views.console import console, table
from cli.views.goals import GoalRow, goal_page, goal_rows, goals_table
from cli.views.history import history_table, joined
from cli.views.live import AsJson, change_line
from cli.views.plan_tree import in_order, plan_tree
from cli.views.tasks import reports_table
from cli.views.text import outcome
from fleet.history.entries import entry_of
from keyexpr_schema.ids import natural_order
from keyexpr_schema.keyspace import GOAL_STATUS, ROBOT_STATE
from keyexpr_schema.payloads.goals import Condition, Goal, GoalAddress, GoalState, GoalStatus
from keyexpr_schema.payloads.history import GoalRecord, PastEntry
from keyexpr_schema.payloads.plans import Plan, PlanState, PlanStatus, Task, Violation
from keyexpr_schema.payloads.robots import RobotActivity, RobotAddress, RobotState
from keyexpr_schema.payloads.tasks import Report, ReportState, TaskRecord, TaskState
from keyexpr_schema.payloads.waits import WaitKind, WaitReason
from keyexpr_schema.transport.watch import Change
from tests.support.past_records import past_goal, past_plan

GOAL = "bring"
TASKS = (
    Task(
        task="t2",
        skill="pick",
        args={"robot": "?a1", "object": "cup_1"},
        actor="a1",
        after=("t1",),
        goal=GOAL,
        duration_s=8.0,
    ),
    Task(
        task="t1",
        skill="navigate",
        args={"robot": "?a1", "place": "kitchen"},
        actor="a1",
        goal=GOAL,
    ),
)
PLAN = Plan(
    plan="p1",
    goals=(GOAL,),
    conditions=(Condition(relation="at", subject="cup_1", value="hallway"),),
    tasks=TASKS,
)


def drawn(what: RenderableType) -> str:
    file = io.StringIO()
    console(file).print(what)
    return file.getvalue()


def test_the_tree_shows_goals_tasks_dependencies_actors_states_and_times() -> None:
    status = PlanStatus(
        plan="p1", revision=1, state=PlanState.RUNNING, allocation={"a1": "hsr"}, made_by="symbolic"
    )
    running = TaskRecord(
        plan="p1",
        revision=1,
        task="t2",
        skill="pick",
        args={"robot": "hsr", "object": "cup_1"},
        actor="a1",
        robot="hsr",
        state=TaskState.RUNNING,
        attempt=2,
        started_s=10.0,
    )
    text = drawn(
        plan_tree(
            PLAN,
            status,
            {"t2": running},
            {GOAL: Goal(goal=GOAL, text="Bring [the] cup.")},
            {GOAL: GoalStatus(goal=GOAL, state=GoalState.RUNNING)},
            now_s=13.5,
        )
    )
    lines = [line.strip() for line in text.splitlines()]
    assert lines[0].startswith("p1 revision 1  running")
    assert "“Bring [the] cup.”" in lines[1]
    assert "t1 navigate(place=kitchen)  a1→hsr  waiting" in lines[2]
    assert "t2 pick(object=cup_1)  a1→hsr  running 3.5 s of about 8.0 s" in lines[3]
    assert "attempt 2" in lines[3]
    assert "after t1" in lines[3]


def test_a_goal_that_was_taken_back_does_not_wait_in_a_plan_that_is_over() -> None:
    over = PlanStatus(plan="p1", revision=1, state=PlanState.CANCELLED, goals=())
    assert f"{GOAL}  deleted" in drawn(plan_tree(PLAN, over, {}, {}, {}))


def test_a_goal_that_was_taken_back_says_so_while_its_plan_is_being_cancelled() -> None:
    waits = (WaitReason(kind=WaitKind.CANCELLING, plan="p1"),)
    going = PlanStatus(plan="p1", revision=1, state=PlanState.RUNNING, goals=(), waits_for=waits)
    text = drawn(plan_tree(PLAN, going, {}, {}, {}))
    assert f"{GOAL}  deleted, its tasks are being withdrawn" in text
    assert "\nwaits: p1 is being cancelled" in text


def test_work_of_earlier_revisions_stays_in_the_tree() -> None:
    def earlier(task: str, started_s: float | None) -> TaskRecord:
        return TaskRecord(
            plan="p1",
            revision=1,
            task=task,
            skill="search",
            args={},
            actor="a0",
            robot="hsr",
            state=TaskState.SUCCEEDED if started_s is not None else TaskState.CANCELLED,
            goal=GOAL,
            started_s=started_s,
            ended_s=started_s,
        )

    text = drawn(
        plan_tree(PLAN, None, {"t0": earlier("t0", 1.0), "t9": earlier("t9", None)}, {}, {})
    )
    assert "✓ t0 search()  a0→hsr  succeeded" in text
    assert "t9" not in text


def test_names_with_numbers_are_in_the_order_people_expect() -> None:
    assert sorted(["t10", "t2", "a1", "t1"], key=natural_order) == ["a1", "t1", "t2", "t10"]


def test_a_rejected_plan_shows_why() -> None:
    status = PlanStatus(
        plan="p1",
        revision=1,
        state=PlanState.REJECTED,
        violations=(Violation(code="cycle", sentence="t1 waits for itself."),),
    )
    assert "t1 waits for itself." in drawn(plan_tree(PLAN, status, {}, {}, {}))
    said = replace(status, reason="it was rejected: t1 waits for itself.")
    assert outcome(said) == "it was rejected: t1 waits for itself."


@given(st.data())
def test_tasks_come_after_what_they_wait_for_and_none_is_lost(data: st.DataObject) -> None:
    number = data.draw(st.integers(1, 8))
    after = [
        tuple(f"t{j}" for j in data.draw(st.sets(st.integers(0, i - 1))) if i) if i else ()
        for i in range(number)
    ]
    tasks = [
        Task(task=f"t{i}", skill="wait", args={}, actor="a", after=after[i]) for i in range(number)
    ]
    shuffled = data.draw(st.permutations(tasks))
    places = {task.task: place for place, task in enumerate(in_order(shuffled))}
    assert len(places) == number
    assert all(places[a] < places[task.task] for task in tasks for a in task.after)


def test_a_cycle_is_drawn_not_followed() -> None:
    loop = [
        Task(task="t1", skill="wait", args={}, actor="a", after=("t2",)),
        Task(task="t2", skill="wait", args={}, actor="a", after=("t1", "gone")),
    ]
    assert {task.task for task in in_order(loop)} == {"t1", "t2"}


def test_text_is_never_markup() -> None:
    assert "[bold]x[/bold] :smile:" in drawn(table(["a"], [("[bold]x[/bold] :smile:",)]))


def test_a_change_in_a_line() -> None:
    record = TaskRecord(
        plan="p1",
        revision=1,
        task="t1",
        skill="pick",
        args={"object": "cup_1"},
        actor="a1",
        robot="hsr",
        state=TaskState.FAILED,
        attempt=3,
        ended_s=12.0,
        reason="it slipped",
    )
    assert change_line(record) == (
        12.0,
        "p1/t1 pick(object=cup_1) hsr: failed (attempt 3): it slipped",
    )
    assert change_line(GoalStatus(goal="g", state=GoalState.REACHED, time_s=3.0)) == (
        3.0,
        "goal g is reached",
    )
    assert change_line("anything else") is None


def test_arguments_of_tasks() -> None:
    assert parse_args(["place=kitchen", "object=cup_1"]) == {"place": "kitchen", "object": "cup_1"}
    for bad in (["place"], ["=x"], ["place="], ["a=1", "a=2"]):
        with pytest.raises(BadArgument):
            parse_args(bad)


def test_speeds() -> None:
    assert parse_speed("max") is None
    assert parse_speed("2.5") == 2.5
    for bad in ("fast", "0", "-1", "nan", "inf"):
        with pytest.raises(BadArgument, match=bad):
            parse_speed(bad)


def test_a_table_of_goals_shows_the_beginning_of_what_many_conditions_say() -> None:
    rows = tuple(Condition(relation="at", subject=f"cup_{n}", value="kitchen") for n in range(60))
    status = GoalStatus(goal=GOAL, state=GoalState.WAITING, conditions=rows)
    row = GoalRow(goal=GOAL, spec=Goal(goal=GOAL, text="Tidy up"), status=status)
    shown = drawn(goals_table([row]))
    assert "cup_0" in shown
    assert "…" in shown
    assert "cup_59" not in shown
    assert "cup_59" in drawn(goal_page(row))


def test_of_many_names_that_are_known_the_nearest_are_named() -> None:
    names = [*(f"cup_{n}" for n in range(60)), "kettle"]
    with pytest.raises(Unknown, match=r"known are: kettle, cup_0, cup_1, cup_10, cup_11, …$"):
        check_known("object", "kettel", names)


def test_of_what_ends_it_is_said_where_it_may_have_gone() -> None:
    gone = "what is over is in `robotctl history`"
    for what in ("goal", "plan", "goal or plan", "plan that goes on"):
        for known in ((), ("g2",)):
            with pytest.raises(Unknown, match=f"; {gone}$"):
                check_known(what, "g1", known)
    with pytest.raises(Unknown, match=r"known are: hsr$"):
        check_known("robot", "g1", ["hsr"])


def test_a_goal_that_was_deleted_stands_with_its_plan_in_the_history() -> None:
    def deleted(name: str, plan: str | None) -> PastEntry:
        goal = past_goal(name, GoalState.RUNNING, plan=plan, deleted=True)
        return entry_of(goal, int(name[1:]))

    def ended(number: int, *goals: GoalRecord) -> PastEntry:
        return entry_of(past_plan("plan-1", *goals, state=PlanState.CANCELLED), number)

    old = ended(1)
    entries = [
        deleted("g9", "plan-1"),
        ended(8, past_goal("g0")),
        deleted("g7", "plan-2"),
        deleted("g6", None),
        deleted("g5", "plan-1"),
        deleted("g4", "plan-1"),
        old,
    ]
    shown = joined(entries)
    assert [(each.plan, [goal.goal for goal in each.goals]) for each in shown] == [
        (None, ["g9"]),
        ("plan-1", ["g0", "g4", "g5"]),
        (None, ["g7"]),
        (None, ["g6"]),
        ("plan-1", []),
    ]
    assert shown[-1] is old
    rows = drawn(history_table(entries)).splitlines()
    assert "plan-2" in next(row for row in rows if "Do g7" in row)


def test_what_the_planner_wants_itself_is_listed_with_what_it_is() -> None:
    text = "Put cup 1 down in the kitchen"
    own = GoalStatus(goal="put-down-cup_1", state=GoalState.RUNNING, own=True, understood=text)
    gone = GoalStatus(goal="of-nobody", state=GoalState.RUNNING)
    (row,) = goal_rows({}, {status.goal: status for status in (own, gone)})
    assert (row.goal, row.spec) == ("put-down-cup_1", None)
    assert "Put cup 1" in drawn(goals_table([row]))


def test_changes_as_json_keep_to_what_alone_is_of_interest(
    capsys: pytest.CaptureFixture[str],
) -> None:
    said = AsJson(Filters.of(robots=["hsr"], goals=["g1"]))
    for goal in ("g1", "g2"):
        status = GoalStatus(goal=goal, state=GoalState.WAITING)
        said.on_change(Change(GOAL_STATUS, GoalAddress(goal), status, "0/0"))
    for robot in ("hsr", "locobot"):
        state = RobotState(robot=robot, incarnation="i1", activity=RobotActivity.IDLE)
        said.on_change(Change(ROBOT_STATE, RobotAddress(robot), state, "0/0"))
        said.on_change(Change(ROBOT_STATE, RobotAddress(robot), None, "0/0"))
    keys = [json.loads(line)["key"] for line in capsys.readouterr().out.splitlines()]
    assert keys == ["goals/g1/status", "robots/hsr/state", "robots/hsr/state"]


def test_an_attempt_that_ended_before_its_first_try_has_a_line() -> None:
    report = Report(
        robot="hsr", plan="plan-5", revision=1, task="t4", attempt=1, epoch=1,
        incarnation="hsr-1", state=ReportState.CANCELLED, reason="cancelled during a stop",
    )  # fmt: skip
    shown = drawn(reports_table([report]))
    assert "cancelled during a stop" in shown and "failed" not in shown
