"""Fifty robots in one MuJoCo world with their workers: simulated seconds in a second.

All are at work for the whole while: those with a hand carry cups to the next room and back, the
others drive. Router, planner, simulation and workers are processes on one machine.
"""

from __future__ import annotations

import asyncio
import tempfile
import time
from pathlib import Path
from typing import Any

from benchmarks.scale.keys_run import CONFIRM_S
from benchmarks.scale.processes import processes
from benchmarks.scale.simulated_fleet import rounds, simulated
from keyexpr_schema.keyspace import PLAN_PROPOSAL, SIM_CLOCK, TASK_RECORD
from keyexpr_schema.payloads.plans import PlanAddress
from keyexpr_schema.payloads.tasks import TaskState
from keyexpr_schema.transport.session import Session

ROBOTS = (50,)
LAPS = 8
WATCHED_S = 60.0
BEGIN_S = 120.0


def measure(quick: bool) -> list[dict[str, Any]]:
    """A row for each number of robots."""
    robots, seconds = ((4,), 15.0) if quick else (ROBOTS, WATCHED_S)
    return [asyncio.run(_run(number, seconds)) for number in robots]


async def _run(robots: int, seconds: float) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        async with processes(Path(folder)) as fleet, simulated(fleet, robots, "mujoco") as made:
            plan = rounds("p", robots, LAPS)
            await made.operator.confirm(PLAN_PROPOSAL, PlanAddress("p"), plan, CONFIRM_S)
            async with asyncio.timeout(BEGIN_S), made.operator.watch(TASK_RECORD) as records:
                async for record in records:
                    if record.value is not None and record.value.state is TaskState.RUNNING:
                        break
            children = {"sim": made.sim, "planner": fleet.planner, "router": fleet.router}
            before = {name: child.cpu_s() for name, child in children.items()}
            workers_had_s = sum(worker.cpu_s() for worker in made.workers)
            began_s, began_sim_s = time.perf_counter(), await _clock_s(made.operator)
            await asyncio.sleep(seconds)
            took_s = time.perf_counter() - began_s
            simulated_s = await _clock_s(made.operator) - began_sim_s
            running = await _in_state(made.operator, TaskState.RUNNING)
            return {
                "robots": robots,
                "worker_processes": len(made.workers),
                "times_real_time": simulated_s / took_s,
                "simulated_s": simulated_s,
                "took_s": took_s,
                "running_at_the_end": running,
                "succeeded": await _in_state(made.operator, TaskState.SUCCEEDED),
                "cpu_s": {
                    **{name: child.cpu_s() - before[name] for name, child in children.items()},
                    "workers": sum(w.cpu_s() for w in made.workers) - workers_had_s,
                },
            }


async def _clock_s(operator: Session) -> float:
    async with operator.watch(SIM_CLOCK) as clock:
        async for change in clock:
            if change.value is not None:
                return float(change.value.time_s)
    raise AssertionError("a watch does not end")


async def _in_state(operator: Session, state: TaskState) -> int:
    records = await operator.list(TASK_RECORD, timeout_s=30.0, plan="p")
    return sum(record.state is state for record in records.values())
