"""More robots than stances: who is done makes room for the next one, and comes out of corners."""

from __future__ import annotations

import math

import pytest

from benchmarks.traffic.point_robots import PERIOD_S, PointRobot
from sim.files.mission_file import load_mission
from sim.navigation import Leg, Navigator

REACH_M = (0.435, 0.545)
"""How far from what it takes a robot's axis is, least and most."""

WORK_S = 7.0
"""An arm that puts something down takes about that long."""

XY = tuple[float, float]


class Floor:
    """Point robots in a world, some of them with the arm at work now and then."""

    def __init__(self, mission: str, starts: dict[str, XY]) -> None:
        self.robots = {name: PointRobot((*at, 0.0)) for name, at in starts.items()}
        self.navigator = Navigator(load_mission(mission).world)
        for name, robot in self.robots.items():
            self.navigator.add_robot(name, robot.pose, robot.radius_m, robot.speed_m_s)
        self.time_s = 0.0
        self.works_until: dict[str, float] = {}

    def tick(self) -> dict[str, Leg]:
        for name in self.robots:
            self.navigator.pin(name, self.works_until.get(name, 0.0) > self.time_s)
        poses = {name: robot.pose for name, robot in self.robots.items()}
        legs = self.navigator.tick(self.time_s, poses)
        for name, leg in legs.items():
            self.robots[name].follow(leg)
        self.time_s += PERIOD_S
        names = sorted(self.robots)
        for k, one in enumerate(names):
            for other in names[:k]:
                a, b = self.robots[one], self.robots[other]
                gap = math.dist(a.pose[:2], b.pose[:2]) - a.radius_m - b.radius_m
                assert gap > 0.0, f"{one} and {other} touch at {self.time_s:.2f} s"
        return legs

    def until_done(self, names: set[str], timeout_s: float) -> None:
        """Let them work where they were sent, each once, and then stand there idle."""
        left = set(names)
        while left:
            assert self.time_s < timeout_s, f"{sorted(left)} never got anywhere"
            for name, leg in self.tick().items():
                if name not in left:
                    continue
                assert leg.failed is None, f"{name}: {leg.failed} at {self.time_s:.1f} s"
                if leg.arrived:
                    left.remove(name)
                    self.navigator.cancel(name)
                    self.works_until[name] = self.time_s + WORK_S


def test_ten_robots_work_at_two_tables_one_after_the_other_and_stay_there_when_done() -> None:
    starts = {f"p{k}": (12.9 + 1.2 * (k % 8), 5.0 - 1.2 * (k // 8)) for k in range(10)}
    floor = Floor("warehouse", starts)
    for k, name in enumerate(starts):
        point = ((15.0, 0.97, 0.6), (21.0, 0.97, 0.6))[k % 2]  # the one spot that is best
        floor.navigator.approach(name, point, REACH_M)
    floor.until_done(set(starts), 200.0)


@pytest.mark.parametrize(
    ("mission", "corner", "point", "stance", "start"),
    [
        ("two-cups", (7.6, 5.4), (8.02, 5.0, 0.45), (7.487, 5.094), (6.9, 4.2)),
        ("apartment", (10.9, 8.5), (10.3, 8.99, 0.74), (10.539, 8.332), (10.0, 6.5)),
        ("apartment", (10.3, 8.5), (10.3, 8.99, 0.74), (10.65, 8.384), (10.0, 6.5)),
    ],
)
def test_who_stands_idle_in_a_corner_comes_out_over_what_the_next_one_waits_for(
    mission: str, corner: XY, point: tuple[float, float, float], stance: XY, start: XY
) -> None:
    """All ways out of the corner are nodes that the stance takes."""
    floor = Floor(mission, {"idle": corner, "b": start})
    gap = math.dist(point[:2], stance)
    heading = math.atan2(point[1] - stance[1], point[0] - stance[0])
    floor.navigator.approach("b", point, (gap - 0.01, gap + 0.01), heading)
    floor.until_done({"b"}, 30.0)
    assert math.dist(floor.robots["b"].pose[:2], stance) < 0.1
    assert math.dist(floor.robots["idle"].pose[:2], corner) > 0.5


def test_who_waits_for_room_to_drive_by_itself_has_others_asked_to_leave() -> None:
    floor = Floor("two-cups", {"a": (2.0, 3.0), "idle": (1.0, 2.2)})
    floor.navigator.approach("a", load_mission("two-cups").world.start_point_m("cup_1"), REACH_M)
    floor.until_done({"a"}, 40.0)
    stance = floor.robots["a"].pose
    idle = floor.robots["idle"].pose
    way = [stance[:2], idle[:2]]
    assert not floor.navigator.reserve("a", way)
    floor.works_until["a"] = math.inf
    while not floor.navigator.reserve("a", way):
        assert floor.time_s < 60.0, "idle never left"
        floor.tick()
    assert math.dist(floor.robots["idle"].pose[:2], idle[:2]) > 0.5
    assert math.dist(floor.robots["a"].pose[:2], stance[:2]) < 0.05
