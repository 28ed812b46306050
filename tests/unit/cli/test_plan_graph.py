"""A plan's DAG as text and as DOT, and plans as files."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
from rich.console import RenderableType

from cli.errors import BadFile
from cli.plans.files import read_plan, write_plan
from cli.views.console import console
from cli.views.plan_graph import layers, plan_dot, plan_graph
from cli.views.plans import making_lines
from keyexpr_schema.payloads.goals import Condition
from keyexpr_schema.payloads.plans import Making, Plan, PlanChange, PlanState, PlanStatus, Task


def task(name: str, *after: str) -> Task:
    return Task(task=name, skill="look", args={"robot": "?a1"}, actor="a1", after=after)


def plan(*tasks: Task) -> Plan:
    return Plan(
        plan='p"1',
        goals=(),
        conditions=(Condition(relation="at", subject="cup_1", value="hallway", any_of=("cup_1",)),),
        tasks=tasks,
    )


DIAMOND = (task("t4", "t2", "t3"), task("t2", "t1"), task("t3", "t1"), task("t1"))


def drawn(what: RenderableType) -> str:
    file = io.StringIO()
    console(file).print(what)
    return file.getvalue()


def test_layers_are_what_can_run_at_once() -> None:
    names = [[each.task for each in layer] for layer in layers(DIAMOND)]
    assert names == [["t1"], ["t2", "t3"], ["t4"]]
    assert layers(()) == []


def test_a_circle_and_a_missing_task_are_drawn_all_the_same() -> None:
    broken = plan(task("t1", "t2"), task("t2", "t1"), task("t3", "gone"))
    text = drawn(plan_graph(broken, None, {}))
    assert all(name in text for name in ("t1", "t2", "t3"))
    assert '"gone"' not in plan_dot(broken, None, {})


def test_the_text_says_what_comes_before_and_after() -> None:
    lines = [
        " ".join(line.split()) for line in drawn(plan_graph(plan(*DIAMOND), None, {})).split("\n")
    ]
    assert lines[0] == "1 · t1 look() ?a1 → t2, t3"
    assert lines[-2] == "3 t2, t3 → · t4 look() ?a1"


def test_dot_is_quoted_and_has_every_edge() -> None:
    text = plan_dot(plan(*DIAMOND), None, {})
    assert text.startswith('digraph "p\\"1" {')
    assert text.count("->") == 4
    assert text.endswith("}")


@pytest.mark.parametrize("name", ["plan.yaml", "plan.yml", "plan.json"])
def test_a_plan_that_is_written_is_read_back(tmp_path: Path, name: str) -> None:
    made = Plan(
        plan="p-1",
        goals=("g",),
        conditions=plan().conditions,
        tasks=DIAMOND,
        pins={"a1": "hsr"},
        making=Making(planner="llm", model="m", rounds=2, cost_usd=0.25),
        seeks=("cup_1",),
        autostart=False,
    )
    write_plan(tmp_path / name, made)
    assert read_plan(tmp_path / name) == made
    assert "duration_s" not in (tmp_path / name).read_text()


def test_a_plan_is_written_as_what_its_name_says(tmp_path: Path) -> None:
    with pytest.raises(BadFile, match=r"\.yaml, \.yml, \.json"):
        write_plan(tmp_path / "plan.txt", plan())


def test_how_a_plan_was_made_is_told() -> None:
    making = Making(
        planner="symbolic", model="m", rounds=1, tokens_in=10, tokens_out=20, fallback="no answer"
    )
    status = PlanStatus(
        plan="p",
        revision=3,
        state=PlanState.RUNNING,
        predicted_makespan_s=12.34,
        lower_bound_s=10.0,
        mission_bound_s=8.0,
        planning_time_s=0.5,
        change=PlanChange(kept=1, dropped=2, added=3),
    )
    assert making_lines(making, status) == [
        "made by     symbolic, model m, 1 answer, 10 tokens in, 20 out",
        "fallback    no answer",
        "planning    0.50 s",
        "makespan    12.3 s predicted",
        "            this task graph cannot be done in less than 10.0 s",
        "            no plan for this mission is shorter than 8.0 s",
        "change      revision 3 kept 1, dropped 2, added 3 of the unfinished tasks",
    ]
