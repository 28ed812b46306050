"""Laws of traffic: everybody arrives, nobody touches anybody, and space has one owner at a time.

Point robots follow the navigator's legs, holonomic ones and differential ones, at their own speeds.
"""

from __future__ import annotations

import math
import random

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from benchmarks.traffic.point_robots import PERIOD_S, PointRobot
from keyexpr_schema.payloads.closures import Closure, Rectangle
from sim.errors import SimError
from sim.files.mission_file import load_mission
from sim.navigation import Leg, Navigator
from sim.navigation.clearance import Clearance
from sim.navigation.floor import nodes_about
from sim.navigation.spots import Spots
from tests.support.reached import Reached, reaches

WORLD = load_mission("two-cups").world
CLEARANCE = Clearance(WORLD)
LATTICE = Spots(WORLD).lattice


class Floor:
    """Robots in home.yaml, with the laws checked at every period."""

    def __init__(self, robots: dict[str, PointRobot]) -> None:
        self.robots, self.time_s = robots, 0.0
        self.navigator = Navigator(WORLD)
        for name, robot in robots.items():
            self.navigator.add_robot(name, robot.pose, robot.radius_m, robot.speed_m_s)
        self._shared: dict[tuple[str, str], frozenset[int]] | None = None

    def tick(self) -> dict[str, Leg]:
        poses = {name: robot.pose for name, robot in self.robots.items()}
        legs = self.navigator.tick(self.time_s, poses)
        for name, leg in legs.items():
            self.robots[name].follow(leg)
        self.time_s += PERIOD_S
        self._check()
        return legs

    def _check(self) -> None:
        names = sorted(self.robots)
        shared = {}
        for k, one in enumerate(names):
            for other in names[:k]:
                a, b = self.robots[one], self.robots[other]
                gap = math.dist(a.pose[:2], b.pose[:2]) - a.radius_m - b.radius_m
                assert gap > 0.0, f"{one} and {other} touch at {self.time_s:.2f} s"
                both = self.navigator.reserved(one) & self.navigator.reserved(other)
                # Those who start close together may share what both stand at, and no more.
                assert self._shared is None or both <= self._shared[one, other]
                shared[one, other] = both
        self._shared = shared
        rooms = CLEARANCE.at(np.array([self.robots[name].pose[:2] for name in names]))
        for name, room in zip(names, rooms, strict=True):
            assert room > self.robots[name].radius_m - 0.01, f"{name} touches a wall"

    def run(self, names: set[str], timeout_s: float = 300.0) -> dict[str, Leg]:
        """Until all of `names` have arrived or failed; their last legs."""
        done: dict[str, Leg] = {}
        while set(done) != names:
            assert self.time_s < timeout_s, f"{sorted(names - set(done))} never got anywhere"
            for name, leg in self.tick().items():
                if name in names and name not in done and (leg.arrived or leg.failed):
                    done[name] = leg
        return done

    def place(self, name: str) -> str | None:
        return WORLD.place_at(*self.robots[name].pose[:2])


def scattered(count: int, seed: int) -> tuple[random.Random, Floor]:
    """Robots of different kinds at random places, not closer than 0.9 m."""
    rnd = random.Random(seed)
    robots: dict[str, PointRobot] = {}
    while len(robots) < count:
        x, y = rnd.uniform(0.3, 9.7), rnd.uniform(0.3, 5.0)
        gaps = [math.dist(robot.pose[:2], (x, y)) for robot in robots.values()]
        if CLEARANCE.at((x, y)) > 0.3 and min(gaps, default=9.0) > 0.9:
            robots[f"r{len(robots)}"] = PointRobot(
                (x, y, rnd.uniform(-3, 3)),
                rnd.uniform(0.18, 0.25),
                rnd.uniform(0.3, 0.9),
                rnd.random() < 0.5,
            )
    return rnd, Floor(robots)


def everybody_arrives(reached: Reached, count: int, seed: int) -> None:
    """Each robot of a random floor gets three times to where it is sent."""
    rnd, floor = scattered(count, seed)
    left = dict.fromkeys(floor.robots, 3)
    goals = {name: rnd.choice(list(WORLD.place_entries)) for name in floor.robots}
    for name, place in goals.items():
        floor.navigator.go_to_place(name, place)
    while left:
        assert floor.time_s < 400.0, f"{sorted(left)} never got anywhere"
        before = {name: robot.pose for name, robot in floor.robots.items()}
        for name, leg in floor.tick().items():
            moved = math.dist(before[name][:2], floor.robots[name].pose[:2]) > 0.005
            if name not in left:
                reached["made way"] += moved
                continue
            assert leg.failed is None, f"{name}: {leg.failed} at {floor.time_s:.1f} s"
            reached["waited"] += not moved and not leg.arrived
            if leg.arrived:
                reached["arrived"] += 1
                assert floor.place(name) == goals[name]
                left[name] -= 1
                if left[name]:
                    goals[name] = rnd.choice(list(WORLD.place_entries))
                    floor.navigator.go_to_place(name, goals[name])
                else:
                    del left[name]
    reached["all, three times"] += 1


@pytest.mark.parametrize("count", [2, 5])
@reaches("all, three times")
@settings(max_examples=6, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_everybody_arrives_wherever_they_are_sent(reached: Reached, count: int, seed: int) -> None:
    everybody_arrives(reached, count, seed)


@reaches("all, three times", "waited", "made way")
@settings(max_examples=6, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_in_a_crowd_robots_wait_and_make_way_and_arrive(reached: Reached, seed: int) -> None:
    everybody_arrives(reached, 10, seed)


@reaches(least={"stands at a table": 16})
@settings(max_examples=6, deadline=None)
@given(seed=st.integers(0, 10**6))
@example(seed=108)  # a stance a few centimetres from the one where it stands
@example(seed=28050)  # two stances beside the lattice, and no node between them
def test_robots_that_work_at_tables_keep_apart_and_face_what_they_work_at(
    reached: Reached, seed: int
) -> None:
    rnd, floor = scattered(4, seed)
    left = dict.fromkeys(floor.robots, 4)
    points: dict[str, tuple[float, float, float]] = {}

    def send(name: str) -> None:
        while left[name]:
            left[name] -= 1
            top = rnd.choice(WORLD.surfaces())
            point = (top.x_m + rnd.uniform(-0.4, 0.4) * top.length_m, top.y_m - 0.2, top.z_m)
            try:
                floor.navigator.approach(name, point, (0.4, 0.6))
            except SimError:
                continue
            points[name] = point
            return
        del left[name]
        points.pop(name, None)

    for name in floor.robots:
        send(name)
    while left:
        assert floor.time_s < 600.0, f"{sorted(left)} never got anywhere"
        for name, leg in floor.tick().items():
            if name in left and leg.arrived:
                reached["stands at a table"] += 1
                x, y, yaw = floor.robots[name].pose
                px, py, _ = points[name]
                assert 0.36 <= math.dist((x, y), (px, py)) <= 0.64
                assert abs(math.remainder(math.atan2(py - y, px - x) - yaw, math.tau)) < 0.2
            if name in left and (leg.arrived or leg.failed):
                send(name)


def test_two_robots_swap_rooms_through_one_door() -> None:
    floor = Floor({"a": PointRobot((3.0, 3.0, 0.0)), "b": PointRobot((5.0, 3.0, 0.0))})
    floor.navigator.go_to_place("a", "hallway")
    floor.navigator.go_to_place("b", "kitchen")
    legs = floor.run({"a", "b"}, 40.0)
    assert all(leg.failed is None for leg in legs.values())
    assert (floor.place("a"), floor.place("b")) == ("hallway", "kitchen")


def test_an_idle_robot_in_the_door_makes_way() -> None:
    floor = Floor({"idle": PointRobot((4.0, 3.0, 0.0)), "b": PointRobot((8.0, 3.0, 0.0))})
    floor.navigator.go_to_place("b", "kitchen")
    assert floor.run({"b"}, 40.0)["b"].failed is None
    assert floor.place("b") == "kitchen"
    x, y, _ = floor.robots["idle"].pose
    assert math.dist((x, y), (4.0, 3.0)) > 0.5


def test_a_pinned_robot_is_driven_around_and_stays() -> None:
    floor = Floor({"pinned": PointRobot((2.8, 3.0, 0.0)), "b": PointRobot((1.0, 3.0, 0.0))})
    floor.navigator.pin("pinned", True)
    floor.navigator.go_to_place("b", "living_room")
    assert floor.run({"b"}, 40.0)["b"].failed is None
    assert floor.robots["pinned"].pose == (2.8, 3.0, 0.0)


def test_who_cannot_get_past_a_pinned_robot_says_who_stands_in_the_way() -> None:
    floor = Floor({"pinned": PointRobot((4.0, 3.0, 0.0)), "b": PointRobot((1.0, 3.0, 0.0))})
    floor.navigator.pin("pinned", True)
    floor.navigator.go_to_place("b", "living_room")
    leg = floor.run({"b"}, 120.0)["b"]
    assert not leg.arrived
    assert leg.failed == "no way to living_room: pinned stands in the way"
    floor.navigator.pin("pinned", False)
    floor.navigator.go_to_place("b", "living_room")
    assert floor.run({"b"}, 200.0)["b"].failed is None


def test_a_cancelled_robot_comes_to_rest_and_can_be_sent_again() -> None:
    floor = Floor({"a": PointRobot((1.0, 3.0, 0.0))})
    floor.navigator.go_to_place("a", "living_room")
    for _ in range(60):
        floor.tick()
    floor.navigator.cancel("a")
    here = floor.robots["a"].pose
    for _ in range(100):
        leg = floor.tick()["a"]
    assert leg.arrived and math.dist(here[:2], floor.robots["a"].pose[:2]) < 1.3
    floor.navigator.go_to_place("a", "living_room")
    assert floor.run({"a"}, 60.0)["a"].failed is None
    assert floor.place("a") == "living_room"


def test_who_works_at_a_table_is_left_alone_while_others_pass() -> None:
    floor = Floor({"a": PointRobot((2.0, 3.0, 0.0)), "b": PointRobot((5.0, 1.5, 0.0))})
    floor.navigator.approach("a", WORLD.start_point_m("cup_1"), (0.42, 0.56))
    assert floor.run({"a"}, 40.0)["a"].arrived
    stance = floor.robots["a"].pose
    floor.navigator.go_to_place("b", "kitchen")
    floor.run({"b"}, 60.0)
    assert math.dist(stance[:2], floor.robots["a"].pose[:2]) < 0.05


KITCHEN = WORLD.place_entries["kitchen"].region_m
IN_THE_ROOM: Rectangle = (6.9, 2.6, 8.0, 3.4)


def test_who_is_sent_into_a_closed_place_says_at_once_that_it_is() -> None:
    floor = Floor({"a": PointRobot((9.0, 3.0, 0.0)), "b": PointRobot((8.0, 3.0, 0.0))})
    for name in floor.robots:
        floor.navigator.go_to_place(name, "kitchen")
    for _ in range(20):
        floor.tick()
    closed = Closure(closure="c", names=("kitchen",), region_m=KITCHEN, by="ana", reason="wet")
    floor.navigator.close([closed])
    legs = floor.run({"a", "b"}, 3.0)
    assert {leg.failed for leg in legs.values()} == {
        "no way to kitchen: kitchen is closed by ana (wet)"
    }
    floor.navigator.close([])
    for name in floor.robots:
        floor.navigator.go_to_place(name, "kitchen")
    assert all(leg.failed is None for leg in floor.run({"a", "b"}, 60.0).values())


def test_who_is_inside_comes_out_and_may_not_go_back() -> None:
    floor = Floor({"a": PointRobot((2.0, 3.0, 0.0))})
    floor.navigator.close([Closure(closure="c", names=("kitchen",), region_m=KITCHEN)])
    floor.navigator.go_to_place("a", "living_room")
    assert floor.run({"a"}, 60.0)["a"].failed is None
    floor.navigator.go_to_place("a", "kitchen")
    assert floor.run({"a"}, 60.0)["a"].failed == "no way to kitchen: kitchen is closed"


@reaches("went around")
@settings(max_examples=3, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_nobody_drives_into_a_closed_part_of_the_floor(reached: Reached, seed: int) -> None:
    _, floor = scattered(4, seed)
    a, b, c, d = IN_THE_ROOM

    nodes = nodes_about(LATTICE, [IN_THE_ROOM])

    floor.navigator.close([Closure(closure="c", names=("zone",), region_m=(IN_THE_ROOM,))])
    out = {n for n in floor.robots if not floor.navigator.reserved(n) & nodes}
    for name in floor.robots:
        far = "living_room" if floor.robots[name].pose[0] < 5.0 else "kitchen"
        floor.navigator.go_to_place(name, far)
    arrived: set[str] = set()
    while arrived < set(floor.robots):
        assert floor.time_s < 200.0
        for name, leg in floor.tick().items():
            assert leg.failed is None, leg.failed
            arrived |= {name} if leg.arrived else set()
        for name in out:
            x, y, _ = floor.robots[name].pose
            assert not (a < x < c and b < y < d)
    reached["went around"] += 1


@reaches("all, three times")
@settings(max_examples=3, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_one_at_a_time_is_let_in(reached: Reached, seed: int) -> None:
    _, floor = scattered(3, seed)
    box = (3.9, 2.5, 4.1, 3.5)  # the door between kitchen and hallway
    one = Closure(closure="c", names=("door",), region_m=(box,), one_at_a_time=True)
    floor.navigator.close([one])

    nodes = nodes_about(LATTICE, [box])

    def inside() -> set[str]:
        return {name for name in floor.robots if floor.navigator.reserved(name) & nodes}

    left = dict.fromkeys(floor.robots, 3)
    for name in left:
        floor.navigator.go_to_place(name, "kitchen")
    began = inside()
    while left:
        assert floor.time_s < 400.0, f"{sorted(left)} never got anywhere"
        for name, leg in floor.tick().items():
            assert leg.failed is None, leg.failed
            if name in left and leg.arrived:
                left[name] -= 1
                if not left[name]:
                    del left[name]
                else:
                    to = "living_room" if floor.place(name) == "kitchen" else "kitchen"
                    floor.navigator.go_to_place(name, to)
        began &= inside()
        assert len(inside() - began) + bool(began) <= 1
    reached["all, three times"] += 1
