"""The parts of navigation: clearances, the lattice, spots and stances, steering, routes."""

from __future__ import annotations

import math
import random
from typing import Any

import msgspec
import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from sim.errors import NoPath, NoStance
from sim.files.mission_file import load_mission
from sim.files.solids import solids
from sim.files.world_schema import WorldFile
from sim.navigation import Navigator
from sim.navigation.clearance import Clearance, segment_gap
from sim.navigation.distance_field import DistanceField
from sim.navigation.lattice import PITCH_M, WALL_M, Lattice
from sim.navigation.routes import Route, Routes
from sim.navigation.spots import Spots
from sim.navigation.steering import DECELERATION_M_S2, steer

WORLD = load_mission("two-cups").world
CLEARANCE = Clearance(WORLD)
SPOTS = Spots(WORLD)
LATTICE = SPOTS.lattice


def furnished(**changes: object) -> WorldFile:
    return msgspec.structs.replace(WORLD, **changes)


def test_clearance_is_the_distance_to_the_nearest_box() -> None:
    assert CLEARANCE.at((2.5, 3.0)) == pytest.approx(math.hypot(1.45, 0.5))  # the door's jamb
    assert CLEARANCE.at((1.0, 4.0)) == pytest.approx(0.65)  # the kitchen table
    assert CLEARANCE.at([(1.0, 5.0), (-1.0, 3.0)]).tolist() == [0.0, 0.0]
    assert CLEARANCE.along((1.0, 3.0), [(1.0, 5.0), (2.0, 3.0)])[0] == 0.0
    # Over the sofa (0.45 m) there is air, over the counter (0.9 m) there is none.
    assert CLEARANCE.at((8.5, 0.6), above_m=0.6) > 0.0 == CLEARANCE.at((0.4, 1.0), above_m=0.6)


def test_a_turned_box_turns() -> None:
    table = msgspec.structs.replace(WORLD.furniture["kitchen_table"], yaw_deg=90.0)
    world = furnished(furniture={**WORLD.furniture, "kitchen_table": table})
    assert Clearance(world).at((1.0, 4.0)) == pytest.approx(0.3)


def test_gaps_between_segments() -> None:
    assert segment_gap(((0, 0), (1, 0)), ((0, 1), (1, 2))) == 1.0
    assert segment_gap(((0, 0), (2, 2)), ((0, 2), (2, 0))) == 0.0, "they cross"
    assert segment_gap(((0, 0), (2, 0)), ((1, 1), (1, 1))) == 1.0, "a point"
    assert segment_gap(((0, 0), (1, 0)), ((3, 0), (2, 0))) == 1.0, "in one line"
    assert segment_gap(((0, 0), (2, 0)), ((0.5, 1), (1.5, 1))) == 1.0, "side by side"


def test_the_lattice_leads_through_both_doors_and_keeps_off_the_walls() -> None:
    assert set(LATTICE.parts) == {0}
    a, b = LATTICE.points_m[LATTICE.edges[:, 0]], LATTICE.points_m[LATTICE.edges[:, 1]]
    assert CLEARANCE.along(a, b).min() >= WALL_M
    assert np.linalg.norm(a - b, axis=1) == pytest.approx(PITCH_M)
    for x in (4.0, 6.0):
        assert ((a[:, 0] <= x) & (b[:, 0] >= x) & (a[:, 1] == b[:, 1])).any()


def test_doors_off_the_lattice_are_hit_by_shifting_it() -> None:
    for y in (2.75, 3.1, 3.4):
        doors = {
            name: msgspec.structs.replace(door, center_m=(door.center_m[0], y))
            for name, door in WORLD.doors.items()
        }
        lattice = Lattice(furnished(doors=doors))
        places = {WORLD.place_at(*point) for point in lattice.points_m[lattice.parts == 0]}
        assert places == set(WORLD.place_entries)


def test_fields_are_distances_and_go_around_what_is_blocked() -> None:
    start, goal = (
        int(np.argmin(np.linalg.norm(LATTICE.points_m - p, axis=1))) for p in ((1, 3), (9, 3))
    )
    free = LATTICE.field(frozenset({goal}))
    gap = math.dist(LATTICE.points_m[start], LATTICE.points_m[goal])
    assert gap - 1e-6 <= free[start] <= 1.1 * gap + 0.5
    between = int(np.argmin(np.linalg.norm(LATTICE.points_m - (2.2, 3.0), axis=1)))
    assert LATTICE.field(frozenset({goal}), frozenset({between}))[start] > free[start]
    by_door = np.flatnonzero(np.abs(LATTICE.points_m[:, 0] - 4.0) < 0.31).tolist()
    shut = frozenset(n for n in by_door if abs(LATTICE.points_m[n][1] - 3.0) < 0.5)
    assert LATTICE.field(frozenset({goal}), shut)[start] == math.inf


@pytest.mark.parametrize("seed", range(5))
def test_distances_are_the_same_in_whatever_order_they_are_asked_for(seed: int) -> None:
    """And those of scipy over the straight steps, where nothing is slanted or blocked."""
    chance = random.Random(seed)
    nodes = list(range(len(LATTICE)))
    goals, blocked = frozenset(chance.sample(nodes, 3)), frozenset(chance.sample(nodes, 12))
    straight = [tuple((v, PITCH_M, ()) for v in around) for around in LATTICE.neighbours]
    everything = [
        (*steps, *((w, PITCH_M * math.sqrt(2.0), corners) for w, corners in slanted.items()))
        for steps, slanted in zip(straight, LATTICE.diagonals, strict=True)
    ]
    in_order = DistanceField(everything, goals, blocked)
    expected = [in_order[node] for node in nodes]
    at_random, asked = DistanceField(everything, goals, blocked), nodes.copy()
    chance.shuffle(asked)
    assert {node: at_random[node] for node in asked} == dict(enumerate(expected))
    ones = np.ones(len(LATTICE.edges)) * PITCH_M
    graph = coo_array((ones, LATTICE.edges.T), shape=(len(nodes), len(nodes)))
    oracle = dijkstra(graph, directed=False, indices=sorted(goals), min_only=True)
    field = DistanceField(straight, goals, frozenset())
    assert [field[node] for node in nodes] == pytest.approx(oracle.tolist())


def test_what_is_near_is_found_without_a_look_at_the_whole_floor() -> None:
    class Counted(list):
        looked_at = 0

        def __getitem__(self, node):
            Counted.looked_at += 1
            return super().__getitem__(node)

    steps = Counted(tuple((v, PITCH_M, ()) for v in around) for around in LATTICE.neighbours)
    goal = LATTICE.neighbours.index(max(LATTICE.neighbours, key=len))
    field = DistanceField(steps, frozenset({goal}), frozenset())
    assert field[LATTICE.neighbours[goal][0]] == PITCH_M
    assert Counted.looked_at <= 5 < len(LATTICE)


def test_nobody_waits_in_a_door() -> None:
    for place, nodes in SPOTS.waiting.items():
        assert len(nodes) >= 5, place
        for node in nodes:
            x, y = LATTICE.points_m[node]
            assert WORLD.place_at(x, y) == place
            for door in WORLD.doors.values():
                assert math.dist((x, y), door.center_m) >= 1.0


def test_stances_reach_what_they_face_and_nothing_is_in_the_way() -> None:
    x, y, z = WORLD.start_point_m("cup_1")
    docks = SPOTS.stances((x, y, z), 0.25, (0.42, 0.56))
    assert docks
    for dock in docks:
        assert 0.42 - 1e-9 <= math.dist(dock.point_m, (x, y)) <= 0.56 + 1e-9
        assert CLEARANCE.at(dock.point_m) >= 0.27
        node = LATTICE.points[dock.node]
        assert CLEARANCE.along(node, [dock.point_m])[0] >= 0.27
        facing = math.atan2(y - dock.point_m[1], x - dock.point_m[0])
        assert dock.yaw_rad == pytest.approx(facing)
        far = [n for n in range(len(LATTICE)) if n not in dock.owned]
        gaps = [segment_gap((dock.point_m, node), (LATTICE.points[n],) * 2) for n in far]
        assert min(gaps) >= 0.6 - 1e-3


def test_no_stance_reaches_through_a_wall() -> None:
    for dock in SPOTS.stances((3.8, 1.0, 0.5), 0.2, (0.4, 0.6)):
        assert dock.point_m[0] < 3.95


def test_what_cannot_be_is_said_before_anybody_drives() -> None:
    navigator = Navigator(WORLD)
    navigator.add_robot("a", (3.0, 3.0, 0.0), 0.2)
    why = (
        r"does not get to \(0\.40, 1\.00\): it must stand 0\.05 to 0\.20 m away, and there is room"
    )
    with pytest.raises(NoStance, match=why + r" only 0\.\d\d m away"):
        navigator.approach("a", (0.4, 1.0, 0.9), (0.05, 0.2))
    with pytest.raises(NoPath, match=r"the largest that traffic is laid out for is 0\.25 m"):
        navigator.add_robot("b", (1.0, 3.0, 0.0), 0.4)
    shut = Navigator(furnished(doors={}))
    shut.add_robot("a", (3.0, 3.0, 0.0), 0.2)
    with pytest.raises(NoPath, match="there is no way to hallway from where a stands"):
        shut.go_to_place("a", "hallway")


def test_a_robot_brakes_for_the_end_and_for_turns() -> None:
    def limit(here: float, *ahead: tuple[float, float]) -> float:
        return steer(
            (here, 0.0, 0.0),
            [(0.0, 0.0), *ahead],
            on_line=True,
            yaw_rad=None,
            speed_m_s=0.6,
            failed=None,
        ).speed_limit_m_s

    assert limit(0.0, (0.6, 0.0), (1.2, 0.0)) == 0.6
    assert limit(1.0, (1.2, 0.0)) <= math.sqrt(2 * DECELERATION_M_S2 * 0.2)
    assert limit(1.2, (1.2, 0.0)) == 0.0
    assert limit(0.45, (0.6, 0.0), (0.6, 0.6), (0.6, 1.2)) < 0.6


def test_a_route_is_driven_from_end_to_end() -> None:
    route = Route([(0.0, 0.0), (3.0, 0.0), (3.0, 1.0)], 1.0, 0)
    assert route.length_m == 4.0
    assert route.at(0.0)[:2] == (0.0, 0.0)
    assert route.at(0.5) == pytest.approx((2.0, 0.0, 0.0))
    assert route.at(0.875) == pytest.approx((3.0, 0.5, math.pi / 2))
    assert route.at(1.0) == (3.0, 1.0, 1.0)


def test_routes_prefer_spots_that_are_free() -> None:
    routes = Routes(WORLD)
    first = routes.to_place((8.0, 3.0, 0.0), "kitchen", set())
    assert first is not None
    second = routes.to_place((8.0, 3.0, 0.0), "kitchen", {first.node})
    assert second is not None and second.node != first.node
    assert routes.to_point((8.0, 3.0, 0.0), (0.2, 1.0, 0.5), 0.3) is None


def test_the_nearest_box_is_found_among_those_that_may_be_the_nearest() -> None:
    """One by one, all boxes give the same as the few that are looked at together."""
    chance = random.Random(7)
    boxes = solids(WORLD)

    def gap(x: float, y: float) -> float:
        gaps = []
        for box in boxes:
            dx, dy = x - box.center_m[0], y - box.center_m[1]
            c, s = math.cos(box.yaw_rad), math.sin(box.yaw_rad)
            along, across = abs(c * dx + s * dy), abs(c * dy - s * dx)
            out = max(along - box.half_m[0], 0.0), max(across - box.half_m[1], 0.0)
            gaps.append(math.hypot(*out))
        return min(gaps)

    for spread_m in (0.0, 0.5, 4.0):
        x, y = chance.uniform(0.5, WORLD.size_m[0] - 0.5), chance.uniform(0.5, 5.5)
        points = [
            (
                min(max(x + chance.uniform(-spread_m, spread_m), 0.0), WORLD.size_m[0]),
                min(max(y + chance.uniform(-spread_m, spread_m), 0.0), WORLD.size_m[1]),
            )
            for _ in range(40)
        ]
        assert CLEARANCE.at(points).tolist() == pytest.approx([gap(*point) for point in points])


@pytest.mark.parametrize("seed", range(5))
def test_a_search_goes_on_where_what_is_blocked_now_is_not_where_it_has_been(seed: int) -> None:
    chance = random.Random(seed)
    nodes = list(range(len(LATTICE)))
    goals, blocked = frozenset(chance.sample(nodes, 1)), frozenset(chance.sample(nodes, 6))
    field = LATTICE.new_field(goals, blocked)
    went_on = began_anew = 0
    for _ in range(200):
        asked = chance.choice(LATTICE.neighbours[min(goals)])
        blocked = (blocked - {chance.choice(sorted(blocked))}) | {chance.choice(nodes)}
        if field.holds_with(blocked):
            went_on += 1
        else:
            began_anew += 1
            field = LATTICE.new_field(goals, blocked)
        assert field[asked] == LATTICE.new_field(goals, blocked)[asked]
    fresh = LATTICE.new_field(goals, blocked)
    assert [field[node] for node in nodes] == [fresh[node] for node in nodes]
    assert not field.holds_with(blocked | {next(n for n in nodes if n not in blocked)})
    assert went_on > 20 < began_anew


def test_robots_that_come_to_rest_far_away_start_no_search_anew(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    begun = 0

    class Counted(DistanceField):
        def __init__(self, *args: Any) -> None:
            nonlocal begun
            begun += 1
            super().__init__(*args)

    monkeypatch.setattr("sim.navigation.floor.DistanceField", Counted)
    navigator = Navigator(WORLD)
    poses = {"a": (2.8, 1.8, 0.0)}
    poses |= {f"b{k}": (9.4 - 0.6 * (k % 2), 1.8 + 0.6 * k, 0.0) for k in range(4)}
    for name, pose in poses.items():
        navigator.add_robot(name, pose, 0.2)
    navigator.go_to_place("a", "hallway")
    navigator.tick(0.0, poses)
    assert begun
    begun = 0
    for number in range(1, 16):
        for bit in range(4):
            navigator.pin(f"b{bit}", bool(number >> bit & 1))
        navigator.tick(0.05 * number, poses)
    assert begun <= 1
