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
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from dataclasses import dataclass, field, replace
from itertools import cycle
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

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


class Restart(NamedTuple):
    """A process that was killed and started again; seconds, and seconds of CPU, until ready."""

    name: str
    ready_s: float
    cpu_s: float


@dataclass(frozen=True)
class Lived:
    """One mission: wall seconds, seconds of CPU of each process, and what it was preceded by."""

    mission: int
    took_s: float
    cpu_s: dict[str, float]
    rss_mb: dict[str, float]
    files_mb: dict[str, float]
    restart: Restart | None = None
    load: float = field(default_factory=lambda: os.getloadavg()[0])


class Soak:
    """A fleet that lives; `mission` is lived through once."""

    def __init__(self, fleet: Processes, made: SimulatedFleet, news: PlannerNews) -> None:
        self.fleet, self.made, self.news = fleet, made, news
        self._children: dict[str, tuple[Child, ...]] = {
            "router": (fleet.router,), "planner": (fleet.planner,),
            "workers": made.workers, "sim": (made.sim,),
        }  # fmt: skip
        self._killed = cycle((fleet.planner, *made.workers, fleet.router))

    @property
    def operator(self) -> Session:
        """A session of somebody who gives orders."""
        return self.made.operator

    @property
    def cups(self) -> int:
        """How many cups and rooms there are."""
        return len(self.made.mission.world.object_entries)

    @property
    def robots(self) -> tuple[str, ...]:
        """All of them."""
        return tuple(robot.spec.robot for robot in self.made.mission.robots)

    async def restart(self) -> Restart:
        """One of the processes, in turn, gets `kill -9` and is started again."""
        child = next(self._killed)
        await child.kill()
        ready_s = await child.start()
        if ready_s is None:
            raise SystemExit(f"{child.name} was not ready again in time; its log is {child.log}")
        return Restart(child.name, ready_s, child.cpu_s())

    async def mission(self, number: int) -> Lived:
        """Goals, a plan, and all of it done."""
        had_s = self.cpu_s()
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
        return self.lived(number, time.perf_counter() - began_s, had_s)

    def lived(self, number: int, took_s: float, had_s: dict[str, float]) -> Lived:
        """What a mission has taken; before it the processes had had so many seconds of CPU."""
        return Lived(
            mission=number,
            took_s=took_s,
            cpu_s={name: seconds - had_s[name] for name, seconds in self.cpu_s().items()},
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
            text = f"Bring cup {cup} to {self.room(number, cup).replace('_', ' ')}"
            goal = Goal(goal=name, text=text, ordinal=number * self.cups + cup)
            await self.operator.confirm(GOAL_SPEC, GoalAddress(name), goal, CONFIRM_S)
        await self._wait(lambda: all(name in self.news.goals for name in names), number)
        return names

    def room(self, number: int, cup: int) -> str:
        """To which room a mission brings a cup."""
        return f"room_{(cup + 1 - number % 2) % self.cups}"

    def cpu_s(self) -> dict[str, float]:
        """Seconds of CPU that the processes have had, those that run now."""
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


def _four(fleet: Processes) -> AbstractAsyncContextManager[SimulatedFleet]:
    return simulated(fleet, ROBOTS, "kinematic")


@asynccontextmanager
async def soaking(
    folder: Path,
    simulating: Callable[[Processes], AbstractAsyncContextManager[SimulatedFleet]] = _four,
) -> AsyncIterator[Soak]:
    """A fleet in `folder`, and someone who looks on."""
    async with processes(folder) as fleet, simulating(fleet) as made:
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
            kill = number and number % kill_every == 0
            restart = await soak.restart() if kill else None
            lived.append(replace(await soak.mission(number), restart=restart))
            if time.perf_counter() > until_s:
                break
    return lived


def summed_up(lived: Sequence[Lived]) -> list[dict[str, Any]]:
    """Rows for tenths of the missions: medians, without those that come right after a restart."""
    size = max(1, len(lived) // 10)
    rows = []
    for first in range(0, len(lived) - size + 1, size):
        some = lived[first : first + size]
        calm = [one for one in some if one.restart is None] or some
        restarts = [one.restart for one in some if one.restart is not None]
        planner = [restart for restart in restarts if restart.name == "planner"]
        rows.append(
            {
                "missions": f"{first + 1} to {first + len(some)}",
                "took_s": median(one.took_s for one in calm),
                "worst_s": max(one.took_s for one in some),
                "restarts": len(restarts),
                "planner_ready_s": median(r.ready_s for r in planner) if planner else None,
                "planner_ready_cpu_s": median(r.cpu_s for r in planner) if planner else None,
                "cpu_s": _medians([one.cpu_s for one in calm]),
                "rss_mb": some[-1].rss_mb,
                "files_mb": some[-1].files_mb,
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
