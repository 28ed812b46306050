"""A simulated building for any number of robots, its world process, and their workers.

A grid of rooms with a door between any two neighbours; a table with a cup, a robot with a hand and
one that only drives in each. So every robot has something to do without all meeting in one place.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec

from benchmarks.scale.errands import DURATION_S
from benchmarks.scale.keys_run import CONFIRM_S, at_once
from benchmarks.scale.processes import REALM, Child, Processes
from keyexpr_schema.facts import AT, HOLDING, FactKey
from keyexpr_schema.ids import actor_arg
from keyexpr_schema.keyspace import FACT, OBJECT, PLACE, REGION, ROBOT_SPEC
from keyexpr_schema.payloads.closures import RegionAddress
from keyexpr_schema.payloads.goals import Condition
from keyexpr_schema.payloads.plans import Plan, Task
from keyexpr_schema.payloads.robots import RobotAddress
from keyexpr_schema.payloads.world import Fact, FactAddress, ObjectAddress, PlaceAddress
from keyexpr_schema.transport.session import Session, SessionConfig, open_session
from sim.files.mission_file import Mission, load_mission
from sim.files.world_payloads import object_payloads, place_payloads, region_payloads

SIDE_M = 4.0
WORLD_RUNS = "world grid running"
"""How the line begins with which the process of the world says that it is ready."""
START_S = 300.0


@dataclass(frozen=True)
class SimulatedFleet:
    """The processes, and a session of the operator."""

    mission: Mission
    sim: Child
    workers: tuple[Child, ...]
    operator: Session


def building(
    robots: int, battery: dict[str, float] | None = None
) -> tuple[dict[str, Any], dict[str, Any]]:
    """A world file and a mission file, as data; with a `battery` in every robot, a charger in every
    other room."""
    rooms = max(2, math.ceil(robots / 2))
    columns = math.ceil(math.sqrt(rooms))
    rows = math.ceil(rooms / columns)
    corners = {n: (SIDE_M * (n % columns), SIDE_M * (n // columns)) for n in range(columns * rows)}
    size = [SIDE_M * columns, SIDE_M * rows]
    lines_x = [SIDE_M * n for n in range(1, columns)]
    lines_y = [SIDE_M * n for n in range(1, rows)]
    doors = {}
    for number, (x, y) in corners.items():
        middle = SIDE_M / 2
        if (number + 1) % columns:
            doors[f"east_of_{number}"] = _door(number, number + 1, x + SIDE_M, y + middle)
        if number + columns in corners:
            doors[f"north_of_{number}"] = _door(number, number + columns, x + middle, y + SIDE_M)
    world = {
        "world": "grid",
        "size_m": size,
        "places": {
            f"room_{n}": {"label": f"room {n}", "region_m": [[x, y, x + SIDE_M, y + SIDE_M]]}
            for n, (x, y) in corners.items()
        },
        "walls": [{"from_m": [x, 0.0], "to_m": [x, size[1]]} for x in lines_x]
        + [{"from_m": [0.0, y], "to_m": [size[0], y]} for y in lines_y],
        "doors": doors,
        "furniture": {
            f"table_{n}": {
                "kind": "table", "place": f"room_{n}",
                "center_m": [x + 0.9, y + SIDE_M - 0.6], "size_m": [1.2, 0.6, 0.6],
            }
            for n, (x, y) in corners.items()
        }
        | {
            f"charger_{n}": {
                "kind": "charger", "place": f"room_{n}",
                "center_m": [x + 0.2, y + 0.6], "yaw_deg": 90, "size_m": [0.4, 0.2, 0.5],
            }
            for n, (x, y) in corners.items()
            if battery is not None and n % 2 == 0
        },
        "object_kinds": {
            "cup": {"shape": "cylinder", "radius_m": 0.035, "height_m": 0.1, "mass_kg": 0.15}
        },
        "objects": {
            f"cup_{n}": {
                "kind": "cup", "label": f"cup {n}", "on": f"table_{n}", "at_m": [-0.3, -0.1]
            }
            for n in range(rooms)
        },
    }  # fmt: skip
    starts = []
    for number in range(robots):
        x, y = corners[number // 2]
        at = [x + 1.0, y + 1.0] if number % 2 == 0 else [x + SIDE_M - 1.0, y + 1.0]
        spec = "hsr" if number % 2 == 0 else "locobot"
        own: dict[str, Any] = {} if battery is None else {"battery": battery}
        start = {"at_m": at, "yaw_deg": 90}
        starts.append({"spec": spec, "robot": f"r{number}", "start": start, **own})
    return world, {"mission": "grid", "world": "grid.world.yaml", "robots": starts}


def _door(one: int, other: int, x: float, y: float) -> dict[str, Any]:
    return {"between": [f"room_{one}", f"room_{other}"], "center_m": [x, y], "width_m": 1.2}


def rounds(name: str, robots: int, laps: int) -> Plan:
    """Every robot with a hand takes its room's cup to the next room and back, the others drive."""
    rooms = max(2, math.ceil(robots / 2))
    tasks: list[Task] = []
    for number in range(robots):
        here, there = f"room_{number // 2}", f"room_{(number // 2 + 1) % rooms}"
        thing = f"cup_{number // 2}"
        for lap in range(laps):
            origin, target = (here, there) if lap % 2 == 0 else (there, here)
            calls = (
                ("navigate", {"to": origin}),
                ("pick", {"object": thing, "place": origin}),
                ("navigate", {"to": target}),
                ("place", {"object": thing, "place": target}),
            )
            for step, (skill, given) in enumerate(calls):
                if number % 2 and skill != "navigate":
                    continue
                task = f"t{1 + step + 4 * (lap + laps * number)}"
                before = tasks[-1].task if tasks and tasks[-1].actor == f"a{number}" else None
                tasks.append(
                    Task(
                        task=task,
                        skill=skill,
                        args={"robot": actor_arg(f"a{number}"), **given},
                        actor=f"a{number}",
                        after=(before,) if before else (),
                        duration_s=DURATION_S,
                    )
                )
    ends = tuple(
        Condition(relation=AT, subject=f"cup_{n}", value=f"room_{(n + laps % 2) % rooms}")
        for n in range(math.ceil(robots / 2))
    )
    return Plan(
        plan=name,
        goals=(),
        conditions=ends,
        tasks=tuple(tasks),
        allocator="round-robin",
        pins={f"a{number}": f"r{number}" for number in range(robots)},
    )


@asynccontextmanager
async def simulated(
    fleet: Processes, robots: int, backend: str, worker_processes: int = 1, speed: str = "max"
) -> AsyncIterator[SimulatedFleet]:
    """The world and the workers of so many robots, at the router of `fleet`."""

    def world(mission: Path) -> Child:
        arguments = ("sim", str(mission), "--backend", backend, "--speed", speed)
        return fleet.robotctl("sim", (WORLD_RUNS,), *arguments)

    async with simulated_in(fleet, building(robots), world, worker_processes) as made:
        yield made


@asynccontextmanager
async def simulated_in(
    fleet: Processes,
    files: tuple[dict[str, Any], dict[str, Any]],
    world_process: Callable[[Path], Child],
    worker_processes: int,
) -> AsyncIterator[SimulatedFleet]:
    """As `simulated`, of a world file and a mission file, and a process that is that world."""
    world, mission = files
    for name, data in (("grid.world.yaml", world), ("grid.yaml", mission)):
        (fleet.folder / name).write_bytes(msgspec.yaml.encode(data))
    file = fleet.folder / "grid.yaml"
    loaded = load_mission(file)
    sim = world_process(file)
    names = tuple(robot.spec.robot for robot in loaded.robots)
    workers = workers_of(fleet, names, worker_processes)
    config = SessionConfig((fleet.endpoint,), realm=REALM, component="benchmark")
    try:
        async with open_session(config) as operator:
            await _put(operator, loaded)
            await sim.start(START_S)
            await asyncio.gather(*(worker.start(START_S) for worker in workers))
            await _until_known(operator, names)
            yield SimulatedFleet(loaded, sim, workers, operator)
    finally:
        await asyncio.gather(*(worker.stop() for worker in workers))
        await sim.stop()


def workers_of(fleet: Processes, robots: tuple[str, ...], processes: int) -> tuple[Child, ...]:
    """So many processes, among which the robots are shared out."""
    shares = [robots[number::processes] for number in range(processes)]
    return tuple(
        fleet.robotctl(
            f"workers-{number}", [f"worker {robot} ready" for robot in share],
            "worker", *share, "--data", str(fleet.folder / f"workers-{number}"),
        )
        for number, share in enumerate(shares)
    )  # fmt: skip


async def _until_known(operator: Session, robots: tuple[str, ...]) -> None:
    """Until every worker has said where its robot is and what it holds: now it can be planned."""
    missing = {FactKey(relation, robot) for relation in (AT, HOLDING) for robot in robots}
    async with asyncio.timeout(START_S), operator.watch(FACT) as facts:
        async for change in facts:
            missing.discard(change.address.key)
            if not missing:
                return


async def _put(operator: Session, mission: Mission) -> None:
    confirm = operator.confirm
    await at_once(
        confirm(PLACE, PlaceAddress(place.place), place, CONFIRM_S)
        for place in place_payloads(mission.world)
    )
    await at_once(
        confirm(REGION, RegionAddress(region.region), region, CONFIRM_S)
        for region in region_payloads(mission.world)
    )
    await at_once(
        confirm(OBJECT, ObjectAddress(thing.object), thing, CONFIRM_S)
        for thing in object_payloads(mission.world)
    )
    await at_once(
        confirm(ROBOT_SPEC, RobotAddress(robot.spec.robot), robot.spec, CONFIRM_S)
        for robot in mission.robots
    )
    facts = [
        Fact(subject=name, relation=AT, value=f"room_{name.rpartition('_')[2]}", source="benchmark")
        for name in mission.world.object_entries
    ]
    await at_once(confirm(FACT, FactAddress.of(fact.key), fact, CONFIRM_S) for fact in facts)
