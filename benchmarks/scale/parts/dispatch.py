"""From the put of the last dependency's report to the order at the worker, and Zenoh beside it.

A plan of 1,000 tasks on 50 robots, whose tasks take about `PACE_S` each; a task waits for the one
that its robot did before, and for nothing else. Once with nothing else to do, once while the
planner is asked for one plan after the other for other goals (dry runs).
"""

from __future__ import annotations

import asyncio
import random
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.scale.errands import TASKS_A_GOAL, Errands
from benchmarks.scale.keys_run import KeysRun, keys_run
from benchmarks.scale.processes import processes
from benchmarks.scale.raw_link import raw_latencies
from keyexpr_schema.keyspace import ANSWER, PLAN_REQUEST
from keyexpr_schema.payloads.requests import PlanRequest, RequestAddress

ROBOTS, TASKS = 50, 1000
PACE_S = 2.0
LIMIT_S = 180.0
OTHERS = range(5000, 5040)
"""Goals that are planned for beside the plan that runs."""


def measure(quick: bool) -> list[dict[str, Any]]:
    """A row without other planning, and one with it."""
    robots, tasks = (10, 80) if quick else (ROBOTS, TASKS)
    return [asyncio.run(_run(robots, tasks, planning)) for planning in (False, True)]


async def _run(robots: int, tasks: int, planning: bool) -> dict[str, Any]:
    rng = random.Random(7)
    pace_s = lambda: rng.uniform(0.5 * PACE_S, 1.5 * PACE_S)  # noqa: E731
    with tempfile.TemporaryDirectory() as folder:
        async with (
            processes(Path(folder)) as fleet,
            keys_run(fleet.endpoint, robots, pace_s) as run,
        ):
            await run.put_fleet()
            wanted = Errands("p", range(tasks // TASKS_A_GOAL), robots)
            for numbers in (wanted.numbers, OTHERS):
                await run.put_cups(numbers)
                await run.put_goals(numbers, LIMIT_S)
            await run.propose(wanted)
            await run.until(lambda: bool(run.ordered), LIMIT_S)
            answered: list[str] = []
            asking = asyncio.create_task(_ask_again_and_again(run, answered, planning))
            async with raw_latencies(fleet.endpoint) as raw:
                await run.until(lambda: "p" in run.ended, LIMIT_S)
            asking.cancel()
            await asyncio.gather(asking, return_exceptions=True)
            return {
                "planning": planning,
                "plans_made": len(answered),
                "robots": robots,
                "tasks": tasks,
                "done": run.done("p"),
                "finished": "p" in run.ended,
                "orders": len(run.latencies_s),
                "order_ms": percentiles_ms(run.latencies_s),
                "raw_ms": percentiles_ms(raw),
            }


async def _ask_again_and_again(run: KeysRun, answered: list[str], planning: bool) -> None:
    """One dry run after the other, where `planning` is wanted."""
    async with run.operator.watch(ANSWER) as answers:
        for number in range(1000 if planning else 0):
            name = f"dry-{number}"
            request = PlanRequest(request=name, goals=tuple(f"g{n}" for n in OTHERS), dry_run=True)
            await run.operator.confirm(PLAN_REQUEST, RequestAddress(name), request, 60.0)
            async for answer in answers:
                if answer.address.request == name:
                    break
            answered.append(name)


def percentiles_ms(seconds: Sequence[float]) -> dict[str, float]:
    """p50, p99 and the most, in ms."""
    ordered = sorted(seconds) or [float("nan")]
    return {
        "p50": 1e3 * ordered[len(ordered) // 2],
        "p99": 1e3 * ordered[int(0.99 * len(ordered))],
        "most": 1e3 * ordered[-1],
    }
