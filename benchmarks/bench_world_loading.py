"""How long large buildings take to load, and how that grows with their area, in one run.

python -m benchmarks.bench_world_loading [--largest]
"""

from __future__ import annotations

import resource
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from sim import load_mission, make_backend
from sim.files.world_file import load_world
from sim.files.world_payloads import place_payloads
from sim.navigation.spots import Spots
from sim.reachability import out_of_reach

SIZES = ((25, 15), (50, 30), (100, 60))
LARGEST = (250, 120)
TARGETS_S = {(50, 30): 2.0, (100, 60): 10.0}
ROOM_M = 5
ROBOTS = 10


def world_text(width: int, depth: int) -> str:
    """Rooms of 5 m by 5 m, each with doors to its neighbours and a cup on a table."""
    rooms = [(i, j) for i in range(width // ROOM_M) for j in range(depth // ROOM_M)]
    lines = [f"world: rooms\nsize_m: [{width}, {depth}]\nplaces:"]
    for i, j in rooms:
        x, y = i * ROOM_M, j * ROOM_M
        box = [x, y, x + ROOM_M, y + ROOM_M]
        lines.append(f"  r{i}_{j}: {{label: Room {i} {j}, region_m: [{box}]}}")
    lines.append("walls:")
    for x in range(ROOM_M, width, ROOM_M):
        lines.append(f"  - {{from_m: [{x}, 0], to_m: [{x}, {depth}]}}")
    for y in range(ROOM_M, depth, ROOM_M):
        lines.append(f"  - {{from_m: [0, {y}], to_m: [{width}, {y}]}}")
    lines.append("doors:")
    for i, j in rooms:
        x, y = i * ROOM_M, j * ROOM_M
        for name, (k, m), at in (
            ("e", (i + 1, j), f"[{x + ROOM_M}, {y + ROOM_M / 2}]"),
            ("n", (i, j + 1), f"[{x + ROOM_M / 2}, {y + ROOM_M}]"),
        ):
            if (k, m) in rooms:
                between = f"between: [r{i}_{j}, r{k}_{m}]"
                lines.append(f"  {name}{i}_{j}: {{{between}, center_m: {at}, width_m: 1.0}}")
    lines.append("furniture:")
    for i, j in rooms:
        where = f"place: r{i}_{j}, center_m: [{i * ROOM_M + 0.9}, {j * ROOM_M + 0.6}]"
        lines.append(f"  t{i}_{j}: {{kind: table, {where}, size_m: [1.2, 0.7, 0.6]}}")
    lines.append("object_kinds:")
    lines.append("  cup: {shape: cylinder, radius_m: 0.035, height_m: 0.1, mass_kg: 0.15}")
    lines.append("objects:")
    lines += [f"  c{i}_{j}: {{kind: cup, on: t{i}_{j}, at_m: [0.0, 0.1]}}" for i, j in rooms]
    return "\n".join(lines) + "\n"


def mission_text(world: Path) -> str:
    """Robots in the middle of the first rooms."""
    lines = [f"mission: rooms\nworld: {world}\nrobots:"]
    for k in range(ROBOTS):
        at = [ROOM_M * (k % 5) + 2.5, ROOM_M * (k // 5) + 2.5]
        lines.append(f"  - {{spec: hsr, robot: hsr_{k}, start: {{at_m: {at}}}}}")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Print what each part takes of process time, and the ratios to the building before."""
    sizes = (*SIZES, LARGEST) if "--largest" in sys.argv else SIZES
    print("| building | file | distances | lattice, spots | reach | physics | all | target | MB |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    before: tuple[float, float] | None = None
    ratios = []
    for width, depth in sizes:
        with tempfile.TemporaryDirectory() as folder:
            world_file, mission_file = Path(folder, "world.yaml"), Path(folder, "mission.yaml")
            world_file.write_text(world_text(width, depth), encoding="utf-8")
            mission_file.write_text(mission_text(world_file), encoding="utf-8")
            mission = load_mission(mission_file)
            steps: tuple[Callable[[], object], ...] = (
                lambda path=world_file: load_world(path),  # type: ignore[misc]
                lambda loaded=mission: place_payloads(loaded.world),  # type: ignore[misc]
                lambda loaded=mission: Spots(loaded.world),  # type: ignore[misc]
                lambda loaded=mission: out_of_reach(loaded),  # type: ignore[misc]
                lambda loaded=mission: make_backend(loaded, "mujoco"),  # type: ignore[misc]
            )
            taken = []
            for step in steps:
                started = time.process_time()
                step()
                taken.append(time.process_time() - started)
        whole = sum(taken)
        megabytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        target = TARGETS_S.get((width, depth))
        row = " | ".join(f"{seconds:.2f} s" for seconds in (*taken, whole))
        wanted = "" if target is None else f"{target:g} s"
        print(f"| {width} x {depth} m | {row} | {wanted} | {megabytes:.0f} |")
        if before is not None:
            area = width * depth / before[0]
            ratios.append(f"{area:.1f} times the area: {whole / before[1]:.1f} times as long")
        before = (width * depth, whole)
    print("\n" + "; ".join(ratios) + ".")


if __name__ == "__main__":
    main()
