"""Idle time by both definitions, on plans small enough to reckon by hand."""

from __future__ import annotations

import io

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cli.plans.idle import idle_report
from cli.views.console import console
from cli.views.idle_time import idle_page
from fleet.core.model.task_graph import Cycle
from fleet.scheduling.idle_time import (
    IdleTime,
    capable,
    measured_idle,
    measured_unit,
    predicted_idle,
    predicted_spans,
    predicted_unit,
    unit_idle,
)
from keyexpr_schema.ids import actor_arg
from keyexpr_schema.payloads.plans import Plan, PlanState, PlanStatus, Task
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.tasks import TaskRecord, TaskState, Try


def task(name: str, actor: str, duration_s: float, *after: str, with_: str = "") -> Task:
    args = {"robot": actor_arg(actor), **({"carrier": actor_arg(with_)} if with_ else {})}
    return Task(
        task=name,
        skill="work",
        args=args,
        actor=actor,
        after=after,
        duration_s=duration_s,
        goal="g",
    )


PLAN = Plan(
    plan="p",
    goals=("g",),
    conditions=(),
    tasks=(
        task("t1", "a1", 10.0),
        task("t2", "a2", 4.0),
        task("t3", "a1", 6.0, "t1", "t2", with_="a2"),
        task("t4", "a3", 5.0),
    ),
)
"""a1 works, then meets a2 for t3; a3 works alone."""
ALLOCATION = {"a1": "arm", "a2": "cart", "a3": "arm"}
SEQUENCE = {"arm": ("a1", "a3"), "cart": ("a2",)}
SKILLS = {"arm": ("work",), "cart": ("work",), "spare": ("work", "x"), "lawnmower": ("mow",)}
SPECS = tuple(
    RobotSpec(robot=name, model="m", skills=skills, capabilities={})
    for name, skills in SKILLS.items()
)
STATUS = PlanStatus(
    plan="p",
    revision=1,
    state=PlanState.SUCCEEDED,
    allocation=ALLOCATION,
    sequence=SEQUENCE,
    predicted_makespan_s=21.0,
    lower_bound_s=20.0,
)


def record(name: str, robot: str, start_s: float, end_s: float, *after: str, **more: object):  # type: ignore[no-untyped-def]
    fields = {"args": {"robot": robot}, "state": TaskState.SUCCEEDED, **more}
    return TaskRecord(
        plan="p", revision=1, task=name, skill="work", actor="a", robot=robot, after=after,
        ordered_s=start_s - 1.0, started_s=start_s, ended_s=end_s, **fields,
    )  # fmt: skip


RECORDS = (
    record("t1", "arm", 101.0, 112.0),
    record("t2", "cart", 101.0, 105.0),
    record("t3", "arm", 112.0, 120.0, "t1", "t2", args={"robot": "arm", "carrier": "cart"}),
    record("t4", "arm", 120.0, 125.0),
)


def test_robots_take_their_actors_in_order_and_partners_are_busy_together() -> None:
    spans = predicted_spans(PLAN, ALLOCATION, SEQUENCE)
    assert spans == {"t1": (0, 10), "t2": (0, 4), "t3": (10, 16), "t4": (16, 21)}
    found = predicted_idle(PLAN, ALLOCATION, SEQUENCE, ("arm", "cart", "spare"))
    assert found.makespan == 21.0
    assert found.busy == {"arm": 21.0, "cart": 10.0, "spare": 0.0}
    assert found.idle == pytest.approx({"arm": 0.0, "cart": 11 / 21, "spare": 1.0})
    assert found.mean == pytest.approx((11 / 21 + 1) / 3)


def test_the_references_definition_counts_steps_and_only_robots_with_tasks() -> None:
    found = predicted_unit(PLAN, ALLOCATION)
    assert found.makespan == 3.0
    assert found.idle == pytest.approx({"arm": 0.0, "cart": 2 / 3})
    assert predicted_unit(PLAN, dict.fromkeys(ALLOCATION, "arm")).mean == 0.0


def test_a_robot_passes_over_tasks_that_wait() -> None:
    """In list order, t1 first: it waits for t3, so that robot r does t2 meanwhile."""
    found = unit_idle({"t1": "r", "t2": "r", "t3": "s"}, {"t1": ("t3",)})
    assert (found.makespan, found.idle) == (2.0, {"r": 0.0, "s": 0.5})
    assert unit_idle({"t1": "r"}, {"t1": ("done",)}).makespan == 1.0
    with pytest.raises(Cycle):
        unit_idle({"t1": "r", "t2": "s"}, {"t1": ("t2",), "t2": ("t1",)})


def test_measured_is_from_the_first_order_to_the_last_end() -> None:
    found = measured_idle(RECORDS, ("arm", "cart", "spare"))
    assert found.makespan == 25.0
    assert found.busy == {"arm": 24.0, "cart": 12.0, "spare": 0.0}
    assert measured_unit(RECORDS).idle == pytest.approx({"arm": 0.0, "cart": 2 / 3})
    tries = (Try(number=1, started_s=100.0, ended_s=101.0, reason="slipped"),)
    again = measured_idle([record("t1", "arm", 105.0, 106.0, tries=tries)], ())
    assert again.busy == {"arm": 2.0}
    assert measured_idle((), ("arm",)) == IdleTime(0.0, {"arm": 0.0})


def test_who_could_have_taken_part_counts() -> None:
    assert capable(PLAN, SPECS) == ("arm", "cart", "spare")


@given(st.lists(st.tuples(st.integers(0, 3), st.sets(st.integers(0, 9))), min_size=1, max_size=10))
def test_steps_are_at_least_the_longest_chain_and_the_largest_share(
    rows: list[tuple[int, set[int]]],
) -> None:
    """And nobody is idle while all that he has to do is ready."""
    robot_of = {f"t{i}": f"r{robot}" for i, (robot, _) in enumerate(rows)}
    after = {f"t{i}": [f"t{b}" for b in befores if b < i] for i, (_, befores) in enumerate(rows)}
    found = unit_idle(robot_of, after)
    depth: dict[str, int] = {}
    for name in robot_of:
        depth[name] = 1 + max((depth[b] for b in after[name]), default=0)
    assert found.makespan >= max(*depth.values(), *found.busy.values(), 1)
    assert sum(found.busy.values()) == len(rows)
    assert found.makespan <= len(rows)
    assert 0.0 <= found.mean < 1.0


def drawn(report) -> str:  # type: ignore[no-untyped-def]
    file = io.StringIO()
    console(file).print(idle_page(report))
    return file.getvalue()


def test_the_page_shows_both_definitions_predicted_and_measured_beside_the_bound() -> None:
    report = idle_report(PLAN, STATUS, RECORDS, SPECS)
    assert report.fleet == ("arm", "cart", "spare")
    assert report.over_bound == pytest.approx(21 / 20)
    assert report.measured_over_bound == pytest.approx(25 / 20)
    lines = [line for line in drawn(report).splitlines() if line and "÷" not in line]
    rows = {line.split()[0]: line for line in lines}
    assert rows["cart"].split() == ["cart", "52.4", "%", "52.0", "%", "66.7", "%", "66.7", "%"]
    assert rows["spare"].split() == ["spare", "100.0", "%", "100.0", "%", "-", "-"]
    assert rows["makespan"].split()[1:3] == ["21.0", "s"]
    assert (
        "makespan ÷ lower bound of this task graph (20.0 s): 1.050 predicted, 1.250 measured"
        in drawn(report)
    )


def test_before_the_run_and_without_a_bound_it_says_so() -> None:
    from msgspec.structs import replace

    waiting = [replace(r, started_s=None, ended_s=None, ordered_s=None) for r in RECORDS]
    report = idle_report(PLAN, replace(STATUS, lower_bound_s=None), waiting, SPECS)
    assert report.measured is None and report.over_bound is None
    assert "gave no lower bound" in drawn(report)
    revised = idle_report(PLAN, replace(STATUS, revision=2), RECORDS, SPECS)
    assert revised.measured_over_bound is None and revised.over_bound is not None
    assert "no robots are allocated yet" in drawn(idle_report(PLAN, None, (), SPECS))
