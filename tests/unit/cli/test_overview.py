"""`status` and `watch` on the screens that people have."""

from __future__ import annotations

import io

import pytest
from msgspec.structs import replace
from rich.cells import cell_len
from rich.console import Console

from cli.client.fleet_view import FleetView
from cli.client.health import Health
from cli.overview.needs import needs_of
from cli.overview.page import FleetPage
from cli.overview.situation import Filters, Situation
from cli.views.waits import waits_shown
from keyexpr_schema.payloads.goals import Condition, Goal, GoalState, GoalStatus
from keyexpr_schema.payloads.holds import Hold, HoldKind
from keyexpr_schema.payloads.plans import PlanState, PlanStatus
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.schedules import ScheduleState, ScheduleStatus
from keyexpr_schema.payloads.stops import Stop
from keyexpr_schema.payloads.system import Diagnostic, UndecodableValue
from keyexpr_schema.payloads.waits import WaitKind, WaitReason
from tests.support.busy_fleet import busy_fleet

HEALTH = Health(frozenset(f"r{number}" for number in range(1, 20)))
HEAD = ["router   tcp/127.0.0.1:7447, realm robotfleet", "planner  running, epoch 3"]


def page(width: int, height: int, filters: Filters = Filters(), **how: bool) -> list[str]:  # noqa: B008
    file = io.StringIO()
    screen = Console(file=file, width=width, height=height, markup=False, highlight=False)
    screen.print(FleetPage(Situation(busy_fleet(), filters, HEALTH), HEAD, **how))
    return file.getvalue().splitlines()


def section(lines: list[str], title: str) -> list[str]:
    """The lines below a title, up to the next one."""
    titles = ("Needs a person", "Held", "Runs", "Waits", "Robots", "Ended")
    start = next(at for at, line in enumerate(lines) if line.startswith(title)) + 1
    ends = (at for at in range(start, len(lines)) if lines[at].startswith(titles))
    return lines[start : next(ends, len(lines))]


@pytest.mark.parametrize(("width", "height"), [(120, 40), (80, 24), (60, 20), (40, 12)])
def test_thirty_goals_and_twenty_robots_fit_a_screen(width: int, height: int) -> None:
    lines = page(width, height)
    assert len(lines) < height, "the prompt needs a line, too"
    assert max(map(cell_len, lines)) <= width
    at = [next(i for i, line in enumerate(lines) if line.startswith(t)) for t in ("Needs", "Runs")]
    assert at == sorted(at)
    assert height < 20 or any("running" in line for line in section(lines, "Runs"))


@pytest.mark.parametrize(("width", "height"), [(120, 40), (80, 24)])
def test_first_what_needs_a_person_then_what_runs_then_what_waits(width: int, height: int) -> None:
    lines = page(width, height)
    needs = section(lines, "Needs a person (5)")
    assert needs[0].startswith("emergency stop s1 by ana@lab (smoke) holds r19, r20; NOT CONFIRMED")
    kinds = ("goal bring-the-cup-30", "plan plan-8 waits for approval", "goal bring-the-cup-29")
    for kind in kinds:
        assert any(line.startswith(kind) for line in needs), kind
    assert section(lines, "Held")[0].startswith("r18: paused by bob@lab (cleaning), since ")
    runs = section(lines, "Runs (2 plans, 12 tasks)")
    assert runs[0].startswith("plan-6 r1  running") and runs[0].rstrip().endswith("is paused")
    assert runs[1].startswith("plan-7 r2  running") and "20/60 tasks, 0/12 goals" in runs[1]
    assert runs[2].split()[:3] == ["r1", "running", "t1"]
    waits = section(lines, "Waits (8 goals, 8 tasks next, 20 behind them)")
    assert waits[0].split() == ["bring-the-cup-13-to-the-living-room", "planned", "plan", "plan-8"]
    assert waits[-1].startswith("… and ") and "robotctl goal list" in waits[-1]
    assert "Ended: goals 8 reached, 1 failed; plans 5 succeeded (`--ended`)" in lines[-1]
    assert not any(line.startswith("plan-1") for line in lines), "what is over is folded"


def test_all_of_it_where_there_is_no_end_of_the_screen() -> None:
    lines = page(120, 24, whole=True, ended=True)
    assert len(section(lines, "Waits")) >= 16
    assert sum(" busy " in line for line in section(lines, "Robots")) == 12
    assert any(line.startswith("plan plan-5") for line in section(lines, "Ended"))
    assert not any(line.startswith("…") for line in lines)


def test_only_what_needs_a_person() -> None:
    lines = page(80, 24, needs_me=True)
    assert lines[2] == "Needs a person (5)"
    assert not any(line.startswith(("Runs", "Waits", "Robots")) for line in lines)
    assert "robotctl goal answer" in " ".join(lines)
    empty = io.StringIO()
    screen = Console(file=empty, width=80, height=24)
    screen.print(FleetPage(Situation(FleetView()), needs_me=True))
    assert empty.getvalue() == "Nothing needs a person.\n"


def test_filters_leave_what_concerns_a_robot_a_goal_or_a_plan() -> None:
    robot = page(100, 40, Filters.of(robots=["r13"]))
    assert [line.split()[0] for line in section(robot, "Waits")] == ["plan-7/t13"]
    assert section(robot, "Robots (1 idle)")[0].split() == ["r13", "idle", "kitchen"]
    goal = page(100, 40, Filters.of(goals=["bring-the-cup-29-to-the-living-room"]))
    assert section(goal, "Needs a person (1)")[0].startswith("goal bring-the-cup-29")
    plan = page(100, 40, Filters.of(plans=["plan-8"]))
    assert "plan plan-8 waits for approval" in section(plan, "Needs a person (1)")[0]
    assert len(section(plan, "Waits")) == 6
    assert not any(line.startswith("Runs (1") for line in plan)


def test_what_needs_a_person_is_data_too() -> None:
    wrong = Diagnostic(component="planner", check="store", sentence="cannot read", since_s=0.0)
    found = needs_of(Situation(busy_fleet(), health=Health(diagnostics=(wrong,))))
    assert [each.kind for each in found] == [
        "stop",
        "diagnostic",
        "question",
        "approval",
        "failed",
        "no-plan",
    ]
    assert found[4].hint == "robotctl goal retry bring-the-cup-29-to-the-living-room"
    assert len(found[5].about) == 2


@pytest.mark.parametrize(("values", "sentences"), [(5, 5), (6, 6), (200, 6)])
def test_many_values_that_nobody_can_read_are_a_few_sentences(values: int, sentences: int) -> None:
    bad = [
        UndecodableValue(component=who, keyexpr=f"world/facts/x{n}/at", reason="not a Fact")
        for who in ("planner", "worker-hsr")
        for n in range(values)
    ]
    more = "bad values at 256 more keys or so"
    bad[values - 1] = replace(bad[values - 1], count=256, reason=more)
    found = needs_of(Situation(FleetView(), health=Health(undecodable=tuple(bad))))
    assert len(found) == 2 * sentences
    assert sorted(key for each in found for key in each.about) == sorted(b.keyexpr for b in bad)
    if values > sentences:
        told = f"planner cannot read 195 more values, such as world/facts/x199/at: {more}"
        assert found[5].sentence == told


def test_what_is_for_later_is_listed_once() -> None:
    """As a schedule, with what clocks will show; where only some goals are wanted, as one."""
    view = FleetView()
    view.goals["cups"] = Goal(goal="cups", text="Search the kitchen every morning.")
    due = WaitReason(kind=WaitKind.DUE, due_s=77_508.5)
    view.goal_status["cups"] = GoalStatus(goal="cups", state=GoalState.STANDING, waits_for=(due,))
    view.schedule_status["cups"] = ScheduleStatus(
        schedule="cups", state=ScheduleState.ACTIVE, next="2026-11-30T08:00:00+01:00"
    )
    assert Situation(view).waiting == []
    [kept] = Situation(view, Filters.of(goals=["cups"])).waiting
    assert kept.what == "cups"


def test_a_goal_that_stands_by_says_for_what() -> None:
    clean = Condition(relation="clean", subject="cup_1", value=True)
    view = FleetView()
    for name, whenever in (("w", (clean,)), ("kept", ())):
        stands = GoalStatus(goal=name, state=GoalState.STANDING, whenever=whenever)
        view.goal_status[name] = stands
    found = {each.what: each.stands for each in Situation(view).waiting}
    assert found == {
        "w": "it stands by, whenever clean(cup_1) = true",
        "kept": "it is kept until somebody deletes it",
    }


def test_who_is_stopped_and_what_ends_it_is_said_of_just_these_robots() -> None:
    view = FleetView()
    view.stops["s"] = Stop(stop="s", robots=("r1", "gone"), by="ana")
    view.robot_specs["r1"] = RobotSpec(robot="r1", model="m", capabilities={}, skills=())
    (need,) = needs_of(Situation(view))
    assert need.sentence.startswith("emergency stop s by ana holds r1, gone (not registered); NOT")
    assert need.hint == "robotctl resume --robot r1 --robot gone"


def test_a_goal_that_was_refused_a_plan_says_why_and_not_that_nobody_asked() -> None:
    view = FleetView()
    for name, sentence in (("closed", "hsr does not get to hallway"), ("a", None), ("b", None)):
        waits = (WaitReason(kind=WaitKind.NO_PLAN, sentence=sentence),)
        view.goal_status[name] = GoalStatus(goal=name, state=GoalState.WAITING, waits_for=waits)
    assert [need.sentence for need in needs_of(Situation(view))] == [
        "goal closed has no plan: hsr does not get to hallway",
        "2 goals wait for a plan that nobody has asked for: a, b",
    ]
    shown = waits_shown(view.goal_status["closed"].waits_for)
    assert shown == "it has no plan: hsr does not get to hallway"


def test_a_plan_that_is_over_is_paused_no_more() -> None:
    view = FleetView()
    for plan, state in (("p1", PlanState.RUNNING), ("p2", PlanState.CANCELLED)):
        view.plan_status[plan] = PlanStatus(plan=plan, revision=1, state=state)
        view.holds[plan] = Hold(hold=plan, kind=HoldKind.PAUSE, plans=(plan,))
    assert [hold.hold for hold in Situation(view).holds] == ["p1"]
