"""Who sets out when ways fill up, and lanes: in a building of rooms along a corridor."""

from __future__ import annotations

import pytest

from benchmarks.traffic.building import building
from benchmarks.traffic.point_robots import PERIOD_S, PointRobot
from sim.navigation import Navigator
from sim.navigation.admission import SAME_GOAL
from sim.navigation.lanes import LANE, lane_costs
from sim.navigation.lattice import PITCH_M
from sim.navigation.spots import Spots


def test_robots_wait_in_their_room_for_a_place_on_the_way_and_do_not_keep_others_back() -> None:
    world = building(4)
    robots = {
        f"r{k}": PointRobot((0.6 + 1.0 * (k % 5), 1.0 + 1.0 * (k // 5), 0.0)) for k in range(10)
    }
    navigator = Navigator(world)
    for name, robot in robots.items():
        navigator.add_robot(name, robot.pose, robot.radius_m, robot.speed_m_s)
        navigator.go_to_place(name, "room_n1" if name == "r9" else "room_n3")
    arrived: list[str] = []
    most = step = 0
    while len(arrived) < len(robots):
        assert step * PERIOD_S < 200.0, f"{sorted(robots.keys() - arrived)} never got anywhere"
        poses = {name: robot.pose for name, robot in robots.items()}
        for name, leg in navigator.tick(step * PERIOD_S, poses).items():
            assert leg.failed is None, leg.failed
            robots[name].follow(leg)
            if leg.arrived and name not in arrived:
                arrived.append(name)
        places = [world.place_at(*robot.pose[:2]) for robot in robots.values()]
        most = max(most, places.count("corridor"))
        step += 1
    assert 2 <= most <= SAME_GOAL + 1, "so many at a time are on their way to one room, and r9"
    assert arrived.index("r9") < 3, "its way is free"


def test_the_rows_of_a_corridor_are_lanes_and_its_columns_and_rooms_are_not() -> None:
    world = building(2)
    lattice = Spots(world).lattice
    costs = lane_costs(lattice)
    ways: dict[float, set[bool]] = {}
    for (u, v), cost in costs.items():
        (ax, ay), (bx, by) = lattice.points[u], lattice.points[v]
        if ax != bx and ay != by:
            continue
        if ay == by and world.place_at(ax, ay) == world.place_at(bx, by) == "corridor":
            assert cost == pytest.approx(PITCH_M * (1.0 if costs[v, u] > cost else 1.0 + LANE))
            if cost < costs[v, u]:
                ways.setdefault(round(ay, 2), set()).add(bx > ax)
        else:
            assert cost == pytest.approx(PITCH_M)
    assert [ways[y] for y in sorted(ways)] == [{True}, {False}, {True}]
