"""The scale benchmarks: errands come to their end in memory, and the page says what came of it."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from benchmarks.scale import report
from benchmarks.scale.core_run import CoreRun
from benchmarks.scale.errands import Errands
from benchmarks.scale.long_life import LongLife
from benchmarks.scale.soak import Lived, Restart, summed_up
from benchmarks.tables import as_json
from keyexpr_schema.payloads.plans import PlanState

TWO = {"p50": 2.0, "p99": 4.0, "most": 5.0}
ONE = {"p50": 1.0, "p99": 3.0, "most": 3.0}


def about(*rows: dict[str, Any]) -> dict[str, Any]:
    return {
        "command": "c", "machine": "m", "commit": "abc", "load_before": 0.5, "load_after": 0.7,
        "took_s": 1.0, "results": rows,
    }  # fmt: skip


CORE = {
    "robots": 1000, "tasks": 10_000, "taken_over_s": 0.5, "done": 10_000, "worked_s": 20.0,
    "tasks_a_second": 500.0, "finished": True, "started_ms": TWO, "succeeded_ms": TWO,
}  # fmt: skip
CUT_OFF = {
    "robots": 50, "tasks": 10_000, "planned_s": 3.0, "done": 120, "worked_s": 60.0,
    "tasks_a_second": 2.0, "finished": False,
    "planner_cpu_s": 1.0, "router_cpu_s": 0.5, "robots_cpu_s": 0.5,
}  # fmt: skip
DISPATCH = {
    "planning": False, "robots": 50, "tasks": 1000, "orders": 950, "order_ms": TWO, "raw_ms": ONE,
}  # fmt: skip
GOALS = [
    {"way": "step", "goals": goals, "told": told, "took_s": 0.1}
    for goals, told in ((1000, 1000), (10_000, 4000))
]
RESTART = {"what": "missions lived", "number": 338, "ready_s": None}


@pytest.mark.parametrize("robots", [2, 3, 10])
def test_errands_are_done_by_all_robots_to_the_end(robots: int) -> None:
    run = CoreRun(robots)
    wanted = run.begin("p", range(7))
    assert len(run.orders) == min(robots, 7)
    run.work()
    assert run.plans["p"] is PlanState.SUCCEEDED
    assert run.succeeded["p"] == wanted.tasks == 28


def test_plans_are_lived_through_one_after_the_other() -> None:
    run = CoreRun(robots=2)
    run.live(3, first=0, goals=2)
    assert list(run.plans.values()) == [PlanState.SUCCEEDED] * 3


@pytest.mark.parametrize("made", [False, True], ids=["while it is planned", "while it is done"])
def test_a_long_life_goes_on_where_it_ended_in_the_middle_of_a_mission(
    tmp_path: Path, made: bool
) -> None:
    with LongLife(tmp_path) as life:
        asyncio.run(life.live_through(3))
        wanted = Errands("m3", [3], robots=4, cups=12)
        life.put_cups([3])
        life.put_goals([3], cups=12)
        answer = life.ask(wanted)
        if made:
            life.apply(answer)
            assert life.state.index.work
    with LongLife(tmp_path) as life:
        assert (life.missions, life.set_aside) == (4, [])
        assert not life.state.plans
        asyncio.run(life.live_through(2))
        assert life.missions == 6


def test_the_page_says_what_was_measured_before_and_now(tmp_path: Path) -> None:
    now = {
        "core": about(CORE),
        "keys": about(CUT_OFF),
        "dispatch": about(DISPATCH),
        "goals": about(*GOALS),
        "restart": about(RESTART),
    }
    before = {"core": about({**CORE, "tasks_a_second": 9.0, "finished": False, "done": 77})}
    for name, parts in (("scale.json", now), ("scale-before.json", before)):
        (tmp_path / name).write_text(as_json(parts), encoding="utf-8")
    report.write(tmp_path)
    page = (tmp_path / "scale.md").read_text(encoding="utf-8")
    assert "| - · - · 9 (of 77, then cut off) | 0.5, 0.7 | - · - · 500 | 0.5, 0.7 |" in page
    assert "not finished in 60 s, 120 tasks done" in page
    assert "p50 2.0, p99 4.0 ms; p50 2.0 x Zenoh's 1.00" in page
    assert "0.10 s · cut off at 4,000" in page
    assert "338: not in 60 s" in page
    assert page.count("`c` at commit abc: 1 s on m; load average 0.5 before, 0.7 after.") == 6
    assert "{" not in page
    assert (tmp_path / "scale.png").stat().st_size > 5000


def test_a_long_life_is_summed_up_without_what_follows_a_restart() -> None:
    def lived(mission: int, took_s: float, restart: Restart | None = None) -> Lived:
        each = dict.fromkeys(("planner", "router", "workers", "sim"), took_s)
        files = dict.fromkeys(("planner", "history", "store", "workers", "logs"), 1.0)
        return Lived(mission, took_s, each, each, files, restart)

    killed = Restart("planner", 0.5, 0.3)
    rows = summed_up([lived(n, 9.0 if n == 5 else 1.0, killed if n == 5 else None)
                      for n in range(30)])  # fmt: skip
    assert len(rows) == 10
    assert [row["took_s"] for row in rows] == [1.0] * 10
    assert rows[1]["worst_s"] == 9.0
    assert (rows[1]["planner_ready_s"], rows[1]["planner_ready_cpu_s"]) == (0.5, 0.3)
    assert rows[0]["planner_ready_s"] is None
