"""Robots that are sent from room to room, again and again, and how many arrive."""

from __future__ import annotations

import math
import random
import time
from dataclasses import dataclass, field

import msgspec
import numpy as np

from benchmarks.traffic.point_robots import PERIOD_S, PointRobot
from sim.files.world_schema import WorldFile
from sim.navigation import Navigator
from sim.navigation.clearance import Clearance


class Outcome(msgspec.Struct, frozen=True, kw_only=True):
    """Of one run: arrivals a minute of simulated time, robots that never arrived, legs that failed,
    times that two footprints met, the longest trip [s], and CPU time for a simulated second [s]."""

    robots: int
    seconds: float
    per_minute: float
    never: int
    failed: int
    contacts: int
    longest_s: float
    cpu_s: float


@dataclass
class Trips:
    """Robots in a building, each sent to a room of chance whenever it has arrived."""

    world: WorldFile
    count: int
    seed: int
    rooms: list[str] = field(default_factory=list)

    def run(self, seconds: float) -> Outcome:
        """Let them drive for so long [simulated s]."""
        rnd = random.Random(self.seed)
        self.rooms = [place for place in self.world.place_entries if place != "corridor"]
        robots = self._scattered(rnd)
        navigator = Navigator(self.world)
        for name, robot in robots.items():
            navigator.add_robot(name, robot.pose, robot.radius_m, robot.speed_m_s)
        goals: dict[str, str] = {}
        since = dict.fromkeys(robots, 0.0)
        arrivals = dict.fromkeys(robots, 0)
        failed = contacts = 0
        longest_s = 0.0
        touching: set[tuple[int, int]] = set()

        def send(name: str) -> None:
            goals[name] = rnd.choice([room for room in self.rooms if room != goals.get(name)])
            navigator.go_to_place(name, goals[name])

        for name in robots:
            send(name)
        began = time.process_time()
        for step in range(round(seconds / PERIOD_S)):
            now_s = step * PERIOD_S
            poses = {name: robot.pose for name, robot in robots.items()}
            for name, leg in navigator.tick(now_s, poses).items():
                robots[name].follow(leg)
                if leg.arrived or leg.failed:
                    failed += leg.failed is not None
                    arrivals[name] += leg.failed is None
                    longest_s = max(longest_s, now_s - since[name])
                    since[name] = now_s
                    send(name)
            met = self._touching(robots)
            contacts += len(met - touching)
            touching = met
        longest_s = max([longest_s, *(seconds - at_s for at_s in since.values())])
        return Outcome(
            robots=self.count,
            seconds=seconds,
            per_minute=60.0 * sum(arrivals.values()) / seconds,
            never=sum(number == 0 for number in arrivals.values()),
            failed=failed,
            contacts=contacts,
            longest_s=longest_s,
            cpu_s=(time.process_time() - began) / seconds,
        )

    def _scattered(self, rnd: random.Random) -> dict[str, PointRobot]:
        """At places of chance in the rooms, not closer than 0.9 m."""
        clearance = Clearance(self.world)
        robots: dict[str, PointRobot] = {}
        while len(robots) < self.count:
            region = self.world.place_entries[rnd.choice(self.rooms)].region_m[0]
            x, y = rnd.uniform(region[0], region[2]), rnd.uniform(region[1], region[3])
            gaps = [math.dist(robot.pose[:2], (x, y)) for robot in robots.values()]
            if clearance.at((x, y)) > 0.35 and min(gaps, default=9.0) > 0.9:
                robots[f"r{len(robots)}"] = PointRobot(
                    (x, y, rnd.uniform(-3.0, 3.0)), 0.25, 0.6, rnd.random() < 0.5
                )
        return robots

    def _touching(self, robots: dict[str, PointRobot]) -> set[tuple[int, int]]:
        """Pairs whose footprints meet."""
        points = np.array([robot.pose[:2] for robot in robots.values()])
        gaps = np.linalg.norm(points[:, None] - points[None], axis=2)
        near = np.argwhere(np.triu(gaps < 0.5, k=1))
        return {(int(a), int(b)) for a, b in near}
