"""How long robots that drive take to rest after an emergency stop, beside raw Zenoh, in one run.

python benchmarks/bench_stop.py [--robots 50] [--rounds 10]

From the put of the stop to the word of each robot's worker that it rests, which is after its driver
has said so; and from a raw put to a subscriber through the same router, taken all along.
"""

from __future__ import annotations

import argparse
import asyncio
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from benchmarks.scale.processes import Processes, processes
from benchmarks.scale.raw_link import raw_latencies
from benchmarks.scale.simulated_fleet import SimulatedFleet, simulated
from benchmarks.tables import machine
from keyexpr_schema.keyspace import ORDER, ROBOT_STATE, STOP
from keyexpr_schema.payloads.robots import RobotActivity
from keyexpr_schema.payloads.stops import Stop, StopAddress
from keyexpr_schema.payloads.tasks import Order, OrderAddress

WORKER_PROCESSES = 5
WAIT_S = 60.0
DEADLINE_S = 3600.0


def quantile(values: Sequence[float], share: float) -> float:
    """The value that so large a share of them does not exceed."""
    return sorted(values)[min(len(values) - 1, int(share * len(values)))]


async def drive(fleet: SimulatedFleet, number: int) -> None:
    """Every robot gets an order to drive into another room, and has begun."""
    rooms = list(fleet.mission.world.place_entries)
    robots = [robot.spec.robot for robot in fleet.mission.robots]
    for index, robot in enumerate(robots):
        to = rooms[(index // 2 + 1 + number % 2) % len(rooms)]
        order = Order(
            robot=robot, plan=f"p{number}", revision=1, task="t1", attempt=1, epoch=1,
            skill="navigate", args={"robot": robot, "to": to}, deadline_s=DEADLINE_S,
        )  # fmt: skip
        await fleet.operator.confirm(ORDER, OrderAddress.of(order), order)
    waiting = set(robots)
    async with asyncio.timeout(WAIT_S), fleet.operator.watch(ROBOT_STATE) as states:
        async for change in states:
            state = change.value
            if state is not None and state.activity is RobotActivity.BUSY:
                waiting.discard(state.robot)
            if not waiting:
                return


async def stop(fleet: SimulatedFleet, name: str) -> list[float]:
    """Stop all; seconds until each has confirmed."""
    waiting = {robot.spec.robot for robot in fleet.mission.robots}
    found: list[float] = []
    async with asyncio.timeout(WAIT_S), fleet.operator.watch(ROBOT_STATE) as states:
        await states.synced()
        put_s = time.perf_counter()
        putting = asyncio.create_task(
            fleet.operator.confirm(STOP, StopAddress(name), Stop(stop=name))
        )
        async for change in states:
            state = change.value
            if state is not None and name in state.stops and state.robot in waiting:
                waiting.discard(state.robot)
                found.append(time.perf_counter() - put_s)
            if not waiting:
                break
        await putting
    return found


async def measure(robots: int, rounds: int) -> None:
    """Print a table."""
    found: list[float] = []
    last: list[float] = []
    with tempfile.TemporaryDirectory() as folder:
        async with processes(Path(folder), planner=False) as fleet:
            raw = await _rounds(fleet, robots, rounds, found, last)
    print(f"{robots} robots that drive, {WORKER_PROCESSES} worker processes, kinematic world in")
    print(f"real time, {rounds} stops; {machine()}\n")
    print("| | p50 | p99 | times raw (p50) |\n| --- | --- | --- | --- |")
    for name, values in (
        ("raw put to subscriber", raw),
        ("stop to a robot's word that it rests", found),
        ("stop to the last robot's word", last),
    ):
        p50, p99 = quantile(values, 0.5), quantile(values, 0.99)
        ratio = p50 / quantile(raw, 0.5)
        print(f"| {name} | {p50 * 1e3:.1f} ms | {p99 * 1e3:.1f} ms | {ratio:.1f} |")


async def _rounds(
    fleet: Processes, robots: int, rounds: int, found: list[float], last: list[float]
) -> list[float]:
    async with simulated(fleet, robots, "kinematic", WORKER_PROCESSES, speed="1") as world:
        async with raw_latencies(fleet.endpoint) as raw:
            for number in range(rounds):
                await drive(world, number)
                times = await stop(world, f"stop-{number}")
                found += times
                last.append(max(times))
                await world.operator.delete(STOP, StopAddress(f"stop-{number}"))
                for robot in world.mission.robots:
                    address = OrderAddress(robot.spec.robot, f"p{number}", "t1")
                    await world.operator.delete(ORDER, address)
        return raw


def main() -> None:
    """Measure as the command line says."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robots", type=int, default=50)
    parser.add_argument("--rounds", type=int, default=10)
    given = parser.parse_args()
    asyncio.run(measure(given.robots, given.rounds))


if __name__ == "__main__":
    main()
