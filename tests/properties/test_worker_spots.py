"""Laws of where things are put down and where one looks from."""

from __future__ import annotations

from math import cos, dist, pi, sin

from hypothesis import given, settings
from hypothesis import strategies as st

from keyexpr_schema.payloads.world import Place, Surface
from tests.support.reached import Reached, reaches
from workers.skills.put_down_spots import (
    APART_M,
    FURNITURE_M,
    REACH_IN_M,
    RIM_M,
    ROBOT_M,
    WALL_M,
    candidates,
    floor_spots,
    surface_spots,
)
from workers.skills.viewpoints import BORDER_M, MOST_CELLS, RANGE_MARGIN, Viewing, cells

metres = st.floats(0.0, 10.0)
points = st.tuples(metres, metres)
surfaces = st.builds(
    Surface,
    surface=st.just("table"),
    x_m=metres,
    y_m=metres,
    z_m=st.just(0.6),
    yaw_rad=st.floats(-pi, pi),
    length_m=st.floats(0.1, 2.0),
    width_m=st.floats(0.1, 1.0),
)


def local(surface: Surface, x_m: float, y_m: float) -> tuple[float, float]:
    c, s = cos(surface.yaw_rad), sin(surface.yaw_rad)
    dx, dy = x_m - surface.x_m, y_m - surface.y_m
    return abs(c * dx + s * dy), abs(-s * dx + c * dy)


@reaches("spots", "empty and large enough")
@given(surfaces, st.lists(points, max_size=6), points)
def test_spots_on_a_surface_are_on_it_free_and_in_reach(
    reached: Reached,
    surface: Surface,
    occupied: list[tuple[float, float]],
    robot: tuple[float, float],
) -> None:
    spots = surface_spots(surface, occupied, robot)
    for x_m, y_m, z_m in spots:
        along, across = local(surface, x_m, y_m)
        inward = min(surface.length_m / 2 - along, surface.width_m / 2 - across)
        assert RIM_M - 1e-9 <= inward <= REACH_IN_M + 1e-9
        assert z_m == surface.z_m
        assert all(dist((x_m, y_m), other) >= APART_M for other in occupied)
    away = [dist(spot[:2], robot) for spot in spots]
    assert away == sorted(away)
    reached["spots"] += bool(spots)
    if min(surface.length_m, surface.width_m) >= 2 * RIM_M and not occupied:
        reached["empty and large enough"] += 1
        assert spots


@reaches("spots among things and robots")
@settings(max_examples=50)
@given(surfaces, st.lists(points, max_size=4), st.lists(points, max_size=3), points)
def test_spots_on_the_floor_keep_clear_of_everything(
    reached: Reached,
    surface: Surface,
    occupied: list[tuple[float, float]],
    robots: list[tuple[float, float]],
    robot: tuple[float, float],
) -> None:
    region = (0.0, 0.0, 6.0, 6.0)
    place = Place(place="room", label="room", region_m=(region,), surfaces=(surface,))
    spots = floor_spots(place, occupied, robots, robot)
    reached["spots among things and robots"] += bool(spots and occupied and robots)
    for x_m, y_m, z_m in spots:
        assert z_m == 0.0
        assert WALL_M - 1e-6 <= x_m <= 6.0 - WALL_M + 1e-6
        assert WALL_M - 1e-6 <= y_m <= 6.0 - WALL_M + 1e-6
        assert all(dist((x_m, y_m), other) >= APART_M for other in occupied)
        assert all(dist((x_m, y_m), other) >= ROBOT_M for other in (*robots, robot))
        along, across = local(surface, x_m, y_m)
        gap = dist(
            (0, 0), (max(0, along - surface.length_m / 2), max(0, across - surface.width_m / 2))
        )
        assert gap >= FURNITURE_M - 1e-6


def test_furniture_comes_before_the_floor_and_a_full_table_leaves_the_floor() -> None:
    table = Surface(surface="t", x_m=3.0, y_m=3.0, z_m=0.6, yaw_rad=0.0, length_m=0.4, width_m=0.4)
    place = Place(place="room", label="room", region_m=((0.0, 0.0, 6.0, 6.0),), surfaces=(table,))
    assert candidates(place, (), (), (1.0, 1.0))[0][2] == 0.6
    full = [(2.8 + 0.1 * i, 2.8 + 0.1 * j) for i in range(5) for j in range(5)]
    assert candidates(place, full, (), (1.0, 1.0))[0][2] == 0.0


@reaches("seen completely", "from several spots")
@settings(max_examples=40, deadline=None)
@given(st.floats(1.0, 20.0), st.floats(1.0, 20.0), st.floats(1.5, 6.0), st.data())
def test_looking_from_the_proposed_spots_sees_the_whole_place(
    reached: Reached, width_m: float, depth_m: float, see_m: float, data: st.DataObject
) -> None:
    place = Place(place="room", label="room", region_m=((0.0, 0.0, width_m, depth_m),))
    viewing = Viewing(place, see_m)
    here = data.draw(st.tuples(st.floats(0.0, width_m), st.floats(0.0, depth_m)))
    looked = [here]
    viewing.looked_from(*here)
    while not viewing.complete and len(looked) < 200:
        spot = viewing.next()
        assert spot is not None
        looked.append(spot)
        viewing.looked_from(*spot)
        viewing.unreachable(spot)
        if viewing.next() is None:
            break
    every = cells(place, BORDER_M)
    in_range = all(min(dist(c, at) for at in looked) <= see_m * RANGE_MARGIN for c in every)
    assert viewing.complete == in_range
    if min(width_m, depth_m) > 1.2 and see_m > 2.0:
        assert viewing.complete
        reached["seen completely"] += 1
        reached["from several spots"] += len(looked) > 2


def test_a_large_hall_is_looked_over_on_a_coarser_grid() -> None:
    hall = Place(place="hall", label="hall", region_m=((0.0, 0.0, 60.0, 40.0),))
    assert len(cells(hall, 0.0)) <= 1.2 * MOST_CELLS


def test_a_spot_one_cannot_get_to_is_not_proposed_again() -> None:
    place = Place(place="room", label="room", region_m=((0.0, 0.0, 4.0, 4.0),))
    viewing = Viewing(place, 1.5)
    viewing.looked_from(0.5, 0.5)
    seen = set()
    while (spot := viewing.next()) is not None:
        assert spot not in seen
        seen.add(spot)
        viewing.unreachable(spot)
    assert seen
