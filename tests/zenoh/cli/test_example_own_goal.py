"""The example of a goal from one's own program, with a real router and the real planner."""

from __future__ import annotations

import asyncio
import sys
from pathlib import Path

from cli.client.world import put_world
from cli.processes.bring_up import router_up
from cli.processes.child_processes import ChildProcesses, free_endpoint
from keyexpr_schema.transport.session import SessionConfig, open_session
from sim.files.world_file import load_world
from sim.files.world_payloads import object_payloads, place_payloads
from tests.support.child_process import child_process
from tests.support.polling import DEADLINE_S

ROOT = Path(__file__).parents[3]


async def example(*words: str) -> tuple[int, str, str]:
    program = str(ROOT / "examples" / "own_goal.py")
    async with child_process(sys.executable, program, *words) as child:
        out, err = await asyncio.wait_for(child.communicate(), DEADLINE_S)
        return child.returncode or 0, out.decode(), err.decode()


async def test_a_goal_is_understood_or_refused_with_a_reason(tmp_path: Path) -> None:
    async with ChildProcesses(free_endpoint(), "robotfleet", tmp_path) as processes:
        processes.declare(
            "router", "router", "--listen", processes.endpoint, "--data", str(tmp_path / "r")
        )
        processes.declare("planner", "planner", "--data", str(tmp_path / "p"), layer=1)
        await processes.start("router")
        await processes.guard(router_up(processes))
        await processes.start("planner")
        world = load_world(ROOT / "configs" / "worlds" / "home.yaml")
        async with open_session(SessionConfig(endpoints=(processes.endpoint,))) as session:
            await put_world(session, place_payloads(world), object_payloads(world))
        code, out, _ = await processes.guard(
            example("Bring the first cup to the hallway.", processes.endpoint)
        )
        assert (code, out.strip()) == (0, "waiting: at(cup_1) = hallway")
        code, out, _ = await processes.guard(
            example("Bring the unicorn to me.", processes.endpoint)
        )
        assert code == 1
        assert out.startswith("rejected: ")
        # Nobody can do it: it says so, and does not wait for ever.
        code, out, _ = await processes.guard(
            example("Bring the second cup to the hallway.", processes.endpoint, "plan")
        )
        assert code == 1
        assert "the planner: no robot is connected" in out
        assert out.splitlines()[-1].startswith(("waiting: ", "the planner: "))


async def test_without_a_router_it_says_so() -> None:
    code, out, err = await example("Anything.", "tcp/127.0.0.1:1")
    assert code == 1
    assert out == ""
    assert err.startswith("Error: no router answers at tcp/127.0.0.1:1")
