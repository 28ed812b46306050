"""The tabulator: names come from the store, and nothing comes where there is none."""

from __future__ import annotations

import asyncio
import os
import subprocess
import sys
from pathlib import Path

from cli.client.publish import put_goal
from keyexpr_schema.keyspace import PLAN_STATUS, ROBOT_SPEC, TASK_RECORD
from keyexpr_schema.payloads.plans import PlanAddress, PlanState, PlanStatus
from keyexpr_schema.payloads.robots import RobotAddress, RobotSpec
from keyexpr_schema.payloads.tasks import TaskAddress, TaskRecord, TaskState
from keyexpr_schema.transport.session import SessionConfig, open_session
from tests.support.polling import DEADLINE_S
from tests.support.router_process import RouterProcess


async def completed(endpoint: str, folder: Path, words: str) -> list[str]:
    """What a shell is told for the last of these words; `_` is one that is not begun."""
    line = words.split()
    done = await asyncio.to_thread(
        subprocess.run,
        [sys.executable, "-m", "cli.main"],
        capture_output=True,
        text=True,
        timeout=DEADLINE_S,
        cwd=folder,
        env={
            **os.environ,
            "HOME": str(folder),
            "ROBOTFLEET_ROUTER": endpoint,
            "_ROBOTCTL_COMPLETE": "complete_bash",
            "COMP_WORDS": " ".join(line).removesuffix("_"),
            "COMP_CWORD": str(len(line) - 1),
        },
    )
    assert done.stderr == ""
    return done.stdout.split()


async def test_names_are_completed(router: RouterProcess, tmp_path: Path) -> None:
    config = SessionConfig((router.endpoint,), "robotfleet", "test")
    async with open_session(config) as session:
        for name in ("tidy-up", "tea"):
            await put_goal(session, "Bring the cup to the kitchen.", name)
        await session.confirm(
            PLAN_STATUS,
            PlanAddress("plan-7"),
            PlanStatus(plan="plan-7", revision=1, state=PlanState.RUNNING),
        )
        for task in ("t1", "t2"):
            record = TaskRecord(
                plan="plan-7",
                revision=1,
                task=task,
                skill="pick",
                args={},
                actor="a1",
                robot=None,
                state=TaskState.WAITING,
            )
            await session.confirm(TASK_RECORD, TaskAddress("plan-7", task), record)
        spec = RobotSpec(robot="hsr", model="hsr", skills=(), capabilities={})
        await session.confirm(ROBOT_SPEC, RobotAddress("hsr"), spec)
    for words, expected in (
        ("robotctl goal delete tea _", ["tidy-up"]),
        ("robotctl plan show _", ["plan-7"]),
        ("robotctl task show plan-7 _", ["t1", "t2"]),
        ("robotctl drain h", ["hsr"]),
        ("robotctl --realm elsewhere goal show _", []),
    ):
        assert await completed(router.endpoint, tmp_path, words) == expected, words


async def test_no_connection_says_nothing(tmp_path: Path) -> None:
    assert await completed("tcp/127.0.0.1:1", tmp_path, "robotctl goal show _") == []
