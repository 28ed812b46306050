"""A fleet kept up through many missions, with its processes killed in between.

`python -m benchmarks.scale.soak [--missions 500] [--kill-every 20]`, or as the part `lifetime` of
`benchmarks.scale.run`. Real processes: router, planner, one worker process for all robots, and a
kinematic world. Every mission is sentences put as goals, a plan asked for, and everything carried
out until each goal is reached; the cups are brought to the next room and back in turn. Every so
many missions one of router, planner and workers gets `kill -9` and is started again.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import tempfile
import time
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from dataclasses import asdict, dataclass, field
from itertools import cycle
from pathlib import Path
from statistics import median
from typing import Any

from rich.console import Console
from rich.table import Table

from benchmarks.scale.keys_run import CONFIRM_S
from benchmarks.scale.planner_news import PlannerNews
from benchmarks.scale.processes import Child, Processes, folder_mb, processes
from benchmarks.scale.simulated_fleet import SimulatedFleet, simulated
from keyexpr_schema.keyspace import GOAL_SPEC, PLAN_REQUEST
from keyexpr_schema.payloads.goals import ENDED_GOALS, Goal, GoalAddress, GoalState
from keyexpr_schema.payloads.requests import PlanRequest, RequestAddress
from keyexpr_schema.transport.session import Session

ROBOTS = 4
MISSION_S = 120.0
"""How long a mission may take before the run counts as failed."""
ARCHIVE = "archive.db"


@dataclass
class Lived:
    """One mission: wall seconds, seconds of CPU of each process, and what it was preceded by."""

    mission: int
    took_s: float
    cpu_s: dict[str, float]
    rss_mb: dict[str, float]
    files_mb: dict[str, float]
    restarted: str | None = None
    ready_s: float | None = None
    load: float = field(default_factory=lambda: os.getloadavg()[0])


class Soak:
    """A fleet that lives; `mission` is lived through once."""

    def __init__(self, fleet: Processes, made: SimulatedFleet, news: PlannerNews) -> None:
        self.fleet, self._made, self.news = fleet, made, news
        self._children: dict[str, tuple[Child, ...]] = {
            "router": (fleet.router,), "planner": (fleet.planner,),
            "workers": made.workers, "sim": (made.sim,),
        }  # fmt: skip
        self._killed = cycle(("planner", "workers", "router"))

    @property
    def operator(self) -> Session:
        """A session of somebody who gives orders."""
        return self._made.operator

    @property
    def cups(self) -> int:
        """How many cups and rooms there are."""
        return len(self._made.mission.world.object_entries)

    @property
    def robots(self) -> tuple[str, ...]:
        """All of them."""
        return tuple(robot.spec.robot for robot in self._made.mission.robots)

    async def restart(self) -> tuple[str, float]:
        """One of the processes is killed and started again: which, and the seconds until ready."""
        name = next(self._killed)
        children = self._children[name]
        await asyncio.gather(*(child.kill() for child in children))
        took_s = await asyncio.gather(*(child.start() for child in children))
        ready_s = [seconds for seconds in took_s if seconds is not None]
        if len(ready_s) < len(children):
            raise SystemExit(f"{name} was not ready again in time; its log is {children[0].log}")
        return name, max(ready_s)

    async def mission(self, number: int) -> Lived:
        """Goals, a plan, and all of it done."""
        had_s = self._cpu_s()
        began_s = time.perf_counter()
        names, operator = await self.put_goals(number), self.operator
        known, ended = self.news.goals, ENDED_GOALS
        request = f"ask-{number}"
        ask = PlanRequest(request=request, plan=f"m{number}", goals=tuple(names))
        await operator.confirm(PLAN_REQUEST, RequestAddress(request), ask, CONFIRM_S)
        await self._wait(lambda: all(known.get(name) in ended for name in names), number)
        missed = [name for name in names if known[name] is not GoalState.REACHED]
        if missed:
            reason = self.news.reasons[missed[0]]
            raise SystemExit(f"{missed[0]} is {known[missed[0]].value}: {reason}")
        took_s = time.perf_counter() - began_s
        return Lived(
            mission=number,
            took_s=took_s,
            cpu_s={name: seconds - had_s[name] for name, seconds in self._cpu_s().items()},
            rss_mb={
                name: sum(child.rss_mb() for child in children)
                for name, children in self._children.items()
            },
            files_mb=self._files_mb(),
        )

    async def put_goals(self, number: int) -> list[str]:
        """The goals of a mission, and until the planner knows of them."""
        names = [f"m{number}-{cup}" for cup in range(self.cups)]
        for cup, name in enumerate(names):
            room = (cup + 1 - number % 2) % self.cups
            text = f"Bring cup {cup} to room {room}"
            goal = Goal(goal=name, text=text, ordinal=number * self.cups + cup)
            await self.operator.confirm(GOAL_SPEC, GoalAddress(name), goal, CONFIRM_S)
        await self._wait(lambda: all(name in self.news.goals for name in names), number)
        return names

    def _cpu_s(self) -> dict[str, float]:
        return {
            name: sum(child.cpu_s() for child in children)
            for name, children in self._children.items()
        }

    async def _wait(self, condition: Callable[[], bool], number: int) -> None:
        if not await self.news.until(condition, MISSION_S):
            raise SystemExit(
                f"mission {number} was not over after {MISSION_S:g} s: {self.news.goals}; "
                f"logs are in {self.fleet.folder}"
            )

    def _files_mb(self) -> dict[str, float]:
        folder = self.fleet.folder
        archives = [path for path in folder.rglob("*") if ARCHIVE in path.name]
        archive_mb = sum(path.stat().st_size for path in archives) / 2**20
        return {
            "store": folder_mb(folder / "router"),
            "planner": folder_mb(folder / "planner") - archive_mb,
            "history": archive_mb,
            "workers": sum(folder_mb(one) for one in folder.glob("workers-*") if one.is_dir()),
            "logs": sum(path.stat().st_size for path in folder.glob("*.log")) / 2**20,
        }


@asynccontextmanager
async def soaking(folder: Path, robots: int = ROBOTS) -> AsyncIterator[Soak]:
    """A fleet in `folder`, and someone who looks on."""
    async with processes(folder) as fleet, simulated(fleet, robots, "kinematic") as made:
        news = PlannerNews()
        following = asyncio.create_task(news.follow_planner(made.operator))
        try:
            yield Soak(fleet, made, news)
        finally:
            following.cancel()
            await asyncio.gather(following, return_exceptions=True)


async def live(folder: Path, missions: int, kill_every: int, limit_s: float) -> list[Lived]:
    """So many missions, or as many as there are in `limit_s`."""
    lived: list[Lived] = []
    until_s = time.perf_counter() + limit_s
    async with soaking(folder) as soak:
        for number in range(missions):
            restarted = ready_s = None
            if number and number % kill_every == 0:
                restarted, ready_s = await soak.restart()
            one = await soak.mission(number)
            one.restarted, one.ready_s = restarted, ready_s
            lived.append(one)
            if time.perf_counter() > until_s:
                break
    return lived


def summed_up(lived: Sequence[Lived]) -> list[dict[str, Any]]:
    """Rows for tenths of the missions: medians, without those that come right after a restart."""
    size = max(1, len(lived) // 10)
    rows = []
    for first in range(0, len(lived) - size + 1, size):
        some = lived[first : first + size]
        calm = [one for one in some if one.restarted is None] or some
        planner = [o.ready_s for o in some if o.restarted == "planner" and o.ready_s is not None]
        rows.append(
            {
                "missions": f"{first + 1} to {first + len(some)}",
                "took_s": median(one.took_s for one in calm),
                "worst_s": max(one.took_s for one in some),
                "restarts": sum(one.restarted is not None for one in some),
                "planner_ready_s": median(planner) if planner else None,
                "cpu_s": _medians([one.cpu_s for one in calm]),
                "rss_mb": asdict(some[-1])["rss_mb"],
                "files_mb": asdict(some[-1])["files_mb"],
                "load": median(one.load for one in some),
            }
        )
    return rows


def _medians(found: Sequence[dict[str, float]]) -> dict[str, float]:
    return {name: median(one[name] for one in found) for name in found[0]}


def main() -> None:
    """Live, and print the table."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--missions", type=int, default=500)
    options.add_argument("--kill-every", type=int, default=20)
    options.add_argument("--limit-s", type=float, default=3600.0)
    given = options.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        lived = asyncio.run(live(Path(folder), given.missions, given.kill_every, given.limit_s))
    table = Table("missions", "took", "worst", "CPU of a mission", "RSS", "files", "load")
    for row in summed_up(lived):
        table.add_row(
            row["missions"],
            f"{row['took_s']:.2f} s",
            f"{row['worst_s']:.2f} s",
            _said(row["cpu_s"], " s", 3),
            _said(row["rss_mb"], " MB", 0),
            _said(row["files_mb"], " MB", 2),
            f"{row['load']:.1f}",
        )
    Console(width=200).print(table)


def _said(numbers: dict[str, float], unit: str, digits: int) -> str:
    return ", ".join(f"{name} {value:.{digits}f}{unit}" for name, value in numbers.items())


if __name__ == "__main__":
    main()
