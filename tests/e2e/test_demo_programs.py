"""Both demonstrations with programs: orders carry several calls; what is found ends a search."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from cli.client.planner_requests import ask_planner, request_name
from cli.client.publish import put_goal, put_statement
from cli.demo.mission_run import REALM, DemoOptions, running_demo
from cli.demo.summary import Summary
from keyexpr_schema.payloads.plans import PlanState
from keyexpr_schema.payloads.programs import ProgramEnd
from keyexpr_schema.payloads.requests import PlanRequest
from keyexpr_schema.payloads.tasks import TaskState
from tests.support.demo_process import demo, left_behind
from tests.support.polling import DEADLINE_S
from tests.support.robotctl import Robotctl

pytestmark = [pytest.mark.e2e, pytest.mark.slow]


@pytest.mark.parametrize("mission", ["two-cups", "find-cup"])
def test_robots_carry_out_programs(tmp_path: Path, mission: str) -> None:
    out = tmp_path / "run"
    done = demo(mission, out, "kinematic", "--programs")
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
    told: dict[str, Any] = json.loads(done.stdout)
    assert {(goal["physics"], goal["planner"]) for goal in told["goals"]} == {("holds", "reached")}
    tasks = [task for task in told["tasks"] if task["start_s"] is not None]
    texts = [task["args"]["text"] for task in tasks if task["skill"] == "do"]
    # What needs nobody else is one order: fetching and bringing, or driving and searching.
    assert any(text.count(";") >= 1 for text in texts)
    assert {task["skill"] for task in tasks} <= {"do", "place_on_robot", "pick_from_robot"}
    if mission == "find-cup":
        assert told["revisions"] == {"plan-1": 2}
        (bring,) = [text for text in texts if "pick cup_1" in text]
        assert bring.endswith("place cup_1 hallway")
    assert left_behind(out) == []


async def test_a_worker_killed_in_the_middle_of_a_program_goes_on_with_it(tmp_path: Path) -> None:
    options = DemoOptions(
        "two-cups", tmp_path, "kinematic", "10", timeout_s=DEADLINE_S, apart=True, programs=True
    )
    async with running_demo(options) as demo:

        def on_the_way() -> bool:
            state = demo.view.robot_states.get("hsr")
            return state is not None and (state.place, state.holding) == ("hallway", "cup_1")

        async def play() -> Summary:
            await demo.submit()
            await demo.view.until(on_the_way, DEADLINE_S, "hsr to be under way with the cup")
            await demo.processes.kill("worker-hsr")
            await demo.processes.start("worker-hsr")
            await demo.wait_until_ended()
            return await demo.verify()

        summary = await demo.processes.guard(play())
        assert summary.ok
        records = [r for r in demo.view.tasks.values() if "pick cup_1" in r.args.get("text", "")]
        (record,) = records
        assert (record.state, record.attempt) == (TaskState.SUCCEEDED, 1)
        assert record.trace is not None and record.trace.end is ProgramEnd.DONE
        assert [call.name for call in record.trace.calls].count("pick") == 1


async def test_a_sentence_is_added_to_a_running_plan_and_carried_out(tmp_path: Path) -> None:
    options = DemoOptions("two-cups", tmp_path / "run", "kinematic", "10", timeout_s=DEADLINE_S)
    async with running_demo(options) as demo:
        robotctl = Robotctl(demo.processes.endpoint, tmp_path, realm=REALM)

        async def play() -> None:
            session, view = demo.session, demo.view
            for text in demo.mission.statements:
                await put_statement(session, text)
            goal = (await put_goal(session, "Bring the second cup to the living room.", None)).goal
            await view.until_read((goal,), "the goal", DEADLINE_S, DEADLINE_S)
            paused = await robotctl.soon("pause", "--all")  # the plan must not end meanwhile
            assert paused.code == 0, paused.err
            await ask_planner(
                session, PlanRequest(request=request_name(), goals=(goal,)), DEADLINE_S
            )
            said = "text=bring the first cup to the hallway"
            added = await robotctl.soon("task", "add", "plan-1", "do", "robot=hsr", said)
            assert added.code == 0, added.err
            nonsense = await robotctl.soon("task", "add", "plan-1", "do", "text=frobnicate it")
            assert nonsense.code == 1 and "frobnicate" in nonsense.err
            assert (await robotctl.soon("resume", "--all")).code == 0

            def done() -> bool:
                status = view.plan_status.get("plan-1")
                records = [record for record in view.tasks.values() if record.skill == "do"]
                return (
                    status is not None
                    and status.state is PlanState.SUCCEEDED
                    and any(record.state is TaskState.SUCCEEDED for record in records)
                )

            def arrived() -> bool:
                return view.truths["cup_1"].place == "hallway"

            await view.until(done, DEADLINE_S, "the plan and its sentence to be done")
            # The simulation says by itself where things are.
            await view.until(arrived, DEADLINE_S, "the first cup to be in the hallway")

        await demo.processes.guard(play())
        (record,) = [r for r in demo.view.tasks.values() if r.skill == "do"]
        assert (record.robot, record.state) == ("hsr", TaskState.SUCCEEDED)
        shown = await robotctl.soon("task", "show", "plan-1", record.task)
        assert "Program (written by symbolic):" in shown.out
        assert "Attempt 1 ended: done" in shown.out
        assert "place(cup_1, hallway)" in shown.out
