"""World, robot and mission files: what they give, and how they say what is wrong with them."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml

from fleet.core.model.ways import open_ways_m
from sim.errors import BadFile
from sim.files.mission_file import load_mission
from sim.files.robot_file import load_robot
from sim.files.solids import solids
from sim.files.world_file import load_world
from sim.files.world_payloads import object_payloads, place_payloads, region_payloads
from sim.navigation.spots import Spots
from sim.reachability import out_of_reach

CONFIGS = Path(__file__).parents[3] / "configs"
HOME = CONFIGS / "worlds" / "home.yaml"
# `on` is a boolean to PyYAML's own loader, and a word to ours.
RAW: dict[str, Any] = yaml.load(HOME.read_text(), yaml.BaseLoader)


def numbers(value: Any) -> Any:
    """What BaseLoader leaves as text, as numbers again."""
    if isinstance(value, dict):
        return {key: numbers(item) for key, item in value.items()}
    if isinstance(value, list):
        return [numbers(item) for item in value]
    try:
        return float(value)
    except ValueError:
        return value


@pytest.fixture
def changed(tmp_path: Path) -> Callable[[Callable[[dict[str, Any]], None]], Path]:
    def make(change: Callable[[dict[str, Any]], None]) -> Path:
        raw = copy.deepcopy(numbers(RAW))
        change(raw)
        path = tmp_path / "world.yaml"
        path.write_text(yaml.safe_dump(raw, sort_keys=False))
        return path

    return make


def set_at(*keys: str, to: Any) -> Callable[[dict[str, Any]], None]:
    def change(raw: dict[str, Any]) -> None:
        for key in keys[:-1]:
            raw = raw[key]
        raw[keys[-1]] = to

    return change


def test_home_says_what_is_in_it() -> None:
    world = load_world(HOME)
    places = {place.place: place for place in place_payloads(world)}
    assert list(places) == ["kitchen", "hallway", "living_room"]
    assert [top.surface for top in places["kitchen"].surfaces] == ["kitchen_table"]
    assert [(o.object, o.kind, o.ordinal, o.label) for o in object_payloads(world)] == [
        ("cup_1", "cup", 1, "first cup"),
        ("cup_2", "cup", 2, "second cup"),
        ("kitchen_table", "table", 1, "kitchen table"),
        ("kitchen_counter", "furniture", 1, "kitchen counter"),
        ("hallway_table", "table", 2, "hallway table"),
        ("coffee_table", "table", 3, "coffee table"),
        ("charger", "charger", 1, "charger"),
        ("sofa", "furniture", 2, "sofa"),
    ]
    assert world.start_point_m("cup_1") == pytest.approx((0.7, 4.8, 0.6))
    assert world.place_at(5.0, 1.0) == "hallway"
    assert world.place_at(-1.0, 1.0) is None


def test_travel_is_symmetric_goes_through_doors_and_obeys_the_triangle_inequality() -> None:
    places = {place.place: place for place in place_payloads(load_world(HOME))}
    for name, place in places.items():
        assert set(place.travel_m) == set(places) - {name}
        for other, metres in place.travel_m.items():
            assert places[other].travel_m[name] == pytest.approx(metres)
    kitchen = places["kitchen"].travel_m
    assert kitchen["living_room"] > kitchen["hallway"] > 1.0
    beyond = kitchen["hallway"] + places["hallway"].travel_m["living_room"]
    assert kitchen["living_room"] == pytest.approx(beyond, abs=0.5)


def test_a_place_behind_a_wall_without_a_door_has_no_travel(changed: Any) -> None:
    def shut(raw: dict[str, Any]) -> None:
        del raw["doors"]["kitchen_door"]

    places = {place.place: place for place in place_payloads(load_world(changed(shut)))}
    assert places["kitchen"].travel_m == {}
    assert set(places["hallway"].travel_m) == {"living_room"}


def test_doors_are_cut_out_of_walls() -> None:
    pieces = [solid for solid in solids(load_world(HOME)) if solid.name.startswith("wall_0")]
    assert sum(2 * piece.half_m[0] for piece in pieces) == pytest.approx(6.0 - 1.0)


def test_a_turned_table_turns_what_lies_on_it(changed: Any) -> None:
    world = load_world(changed(set_at("furniture", "kitchen_table", "yaw_deg", to=90.0)))
    x, y, z = world.start_point_m("cup_1")  # (-0.3, -0.2) in the table's axes
    assert (x, y, z) == pytest.approx((1.0 + 0.2, 5.0 - 0.3, 0.6))
    assert world.surface("kitchen_table").yaw_rad == pytest.approx(math.pi / 2)


@pytest.mark.parametrize(
    ("keys", "value", "said"),
    [
        (("size_m",), [10.0, "wide"], r"size_m\[1\]: expected a number, got text"),
        (("objects", "cup_1", "colour"), "red", r"objects\.cup_1: there is no field `colour`"),
        (("objects", "cup_1", "on"), "shelf", r"objects\.cup_1\.on: there is no table 'shelf'; "),
        (("objects", "cup_1", "on"), "sofa", r"there are kitchen_table, hallway_table, coffee_tab"),
        (("objects", "cup_1", "kind"), "mug", r"there is no kind 'mug'; there are cup"),
        (("objects", "cup_1", "at_m"), [2.0, 0.0], r"\[2\.0, 0\.0\] is not on kitchen_table"),
        (("objects", "cup_2", "at_m"), [-0.28, -0.2], r"cup_2 sticks 5.0 cm into cup_1; move"),
        (("furniture", "sofa", "place"), "attic", r"no place 'attic'; there are kitchen, hallway"),
        (("furniture", "sofa", "center_m"), [1.0, 1.0], r"is not in 'living_room'"),
        (("furniture", "sofa", "size_m"), [1.0, -1.0, 1.0], r"furniture\.sofa\.size_m\[1\]: "),
        (("doors", "kitchen_door", "between"), ["kitchen", "x"], r"doors\.kitchen_door\.between"),
        (
            ("doors", "kitchen_door", "between"),
            ["kitchen", "living_room"],
            r"between: on its two sides are \w+ and \w+, not kitchen and living_room",
        ),
        (("places", "kitchen", "region_m"), [[4, 0, 0, 6]], r"is not \[x_min, y_min, x_max"),
        (("object_kinds", "cup", "shape"), "sphery", r"object_kinds\.cup\.shape: invalid enum"),
        (
            ("object_kinds", "cup", "is"),
            ["vesel"],
            r"cup\.is: there is no kind 'vesel'; there are cup",
        ),
        (("object_kinds", "cup", "is"), ["cup"], r"cup\.is: cup would be a case of itself"),
        (
            ("size_m",),
            [1000.0, 600.0],
            r"size_m\[0\]: .* most 250\.0, got 1000.0; .*centimetres",
        ),
        (
            ("places", "101"),
            {"label": "A", "region_m": [[0, 0, 1, 1]]},
            r"places\.101: .* a number",
        ),
        (("objects", "nothing"), {"kind": "cup", "on": "sofa"}, r"objects\.nothing: .* is a value"),
        (("states",), {"cup_1": {"clean": "unknown"}}, r"states\.cup_1\.clean: say how it is"),
        (("size_m",), [200.0, 160.0], r"size_m: 200 m by 160 m is more than the 30,000 sq"),
        (("object_kinds", "cup", "mass_kg"), 150000, r"cup\.mass_kg: .*; masses .* in grams\?"),
        (("furniture", "sofa", "yaw_deg"), 5000, r"sofa\.yaw_deg: expected .* of at most 360"),
        (("furniture", "sofa", "center_m"), ["8:30", 1.0], r"center_m\[0\]: .*, got text '8:30'"),
        (("roof",), True, r"roof: there is no such field; valid are: world, "),
    ],
)
def test_a_wrong_world_is_one_clear_sentence(
    changed: Any, keys: tuple[str, ...], value: Any, said: str
) -> None:
    path = changed(set_at(*keys, to=value))
    with pytest.raises(BadFile, match=said) as caught:
        load_world(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_file_and_a_file_that_is_not_yaml(tmp_path: Path) -> None:
    with pytest.raises(BadFile, match=r"the world file .*none\.yaml does not exist"):
        load_world(tmp_path / "none.yaml")
    bad = tmp_path / "bad.yaml"
    bad.write_text("world: [home\nsize_m: 3\n")
    with pytest.raises(BadFile, match=r"bad\.yaml is not YAML: line 2"):
        load_world(bad)
    bad.write_text("just words\n")
    with pytest.raises(BadFile, match="a world file is a list of `name: value` lines"):
        load_world(bad)
    bad.write_text("world: home\nsize_m: [1, 1]\nplaces: {}\nsize_m: [2, 2]\n")
    with pytest.raises(BadFile, match=r"bad\.yaml line 4: 'size_m' comes twice"):
        load_world(bad)


def mission(tmp_path: Path, robots: str) -> Path:
    path = tmp_path / "m.yaml"
    path.write_text(f"mission: m\nworld: {HOME}\nrobots:\n{robots}")
    return path


HSR = CONFIGS / "robots" / "hsr.yaml"
SOFA_IN_THE_DOOR = {
    "kind": "sofa",
    "place": "hallway",
    "center_m": [4.05, 3.0],
    "size_m": [1.5, 0.9, 0.5],
    "yaw_deg": 90.0,
}


def test_a_mission_by_name_and_by_path_is_the_same() -> None:
    by_name = load_mission("two-cups")
    assert by_name == load_mission(CONFIGS / "missions" / "two-cups.yaml")
    assert [robot.spec.robot for robot in by_name.robots] == ["hsr", "locobot"]
    assert by_name.robots[1].start_m_rad == pytest.approx((5.0, 1.5, math.pi / 2))
    assert by_name.plan.allocator == "makespan"
    assert len(by_name.goals) == 2 and len(by_name.statements) == 2


def test_an_unknown_mission_lists_those_there_are() -> None:
    with pytest.raises(BadFile, match=r"no mission 'three-cups'; .*two-cups.* \(looked in"):
        load_mission("three-cups")


def test_two_robots_of_one_specification(tmp_path: Path) -> None:
    path = mission(
        tmp_path,
        f"  - {{spec: {HSR}, start: {{at_m: [8, 3]}}}}\n"
        f"  - {{spec: {HSR}, robot: hsr_2, start: {{at_m: [7, 3]}}}}\n",
    )
    assert [robot.spec.robot for robot in load_mission(path).robots] == ["hsr", "hsr_2"]


@pytest.mark.parametrize(
    ("second", "said"),
    [
        (f"{{spec: {HSR}, start: {{at_m: [7, 3]}}}}", r"there are two robots 'hsr'"),
        (
            f"{{spec: {HSR}, robot: b, start: {{at_m: [8.2, 3]}}}}",
            r"\(b\): .* overlaps hsr, 0.20 m",
        ),
        (
            f"{{spec: {HSR}, robot: b, start: {{at_m: [1, 5]}}}}",
            r"from kitchen_table; a robot need",
        ),
        (f"{{spec: {HSR}, robot: b, start: {{at_m: [11, 5]}}}}", r"is outside the building"),
        (f"{{spec: {HSR}, robot: cup_1, start: {{at_m: [7, 3]}}}}", r"has the name 'cup_1'"),
        (f"{{spec: {HSR}, robot: b}}", r"robots\[1\]: it lacks the field `start`"),
        ("{spec: no.yaml, robot: b, start: {at_m: [7, 3]}}", r"the robot file .* does not exist"),
    ],
)
def test_a_wrong_mission_is_one_clear_sentence(tmp_path: Path, second: str, said: str) -> None:
    path = mission(tmp_path, f"  - {{spec: {HSR}, start: {{at_m: [8, 3]}}}}\n  - {second}\n")
    with pytest.raises(BadFile, match=said):
        load_mission(path)


def test_a_speaker_is_one_of_the_people(tmp_path: Path) -> None:
    path = mission(tmp_path, f"  - {{spec: {HSR}, start: {{at_m: [8, 3]}}}}\nspeaker: anna\n")
    with pytest.raises(BadFile, match=r"speaker: there is nobody 'anna' in the world"):
        load_mission(path)


def test_a_robot_that_cannot_drive_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "r.yaml"
    path.write_text("robot: r\nmodel: hsr\nskills: [navigate]\ncapabilities: {see: 4.0}\n")
    with pytest.raises(BadFile, match=r"it lacks `drive`, the robot's top speed in m/s"):
        load_robot(path)
    path.write_text("robot: r\nmodel: hsr\nskills: [navigate]\ncapabilities: {drive: 60}\n")
    with pytest.raises(BadFile, match=r"r.yaml line 4: capabilities.drive: 60.0 .* in cm/s\?"):
        load_robot(path)
    path.write_text("robot: r\nmodel: bench_arm\nskills: [pick]\ncapabilities: {grip: 1.0}\n")
    assert load_robot(path).skills == ("pick",)  # one that does not have to is not
    path.write_text("robot: r\nmodel: hsr\nskills: navigate\ncapabilities: {drive: 1}\n")
    with pytest.raises(BadFile, match=r"skills: expected a list, got text"):
        load_robot(path)


@pytest.mark.parametrize("name", ["a/b", "r$*", "röbot", "", "x" * 64])
def test_a_robot_with_a_name_that_can_be_no_key_is_told_the_rule(tmp_path: Path, name: str) -> None:
    path = tmp_path / "r.yaml"
    path.write_text(
        f"robot: '{name}'\nmodel: hsr\nskills: [navigate]\ncapabilities: {{drive: 1}}\n",
        encoding="utf-8",
    )
    with pytest.raises(BadFile, match=r"robot: expected a name \(1 to 63 ASCII letters, digits"):
        load_robot(path)


def test_what_lies_in_the_middle_of_a_wide_table_is_said_to_be_out_of_reach(
    tmp_path: Path,
) -> None:
    path = mission(tmp_path, f"  - {{spec: {HSR}, start: {{at_m: [8.0, 3.0]}}}}\n")
    assert out_of_reach(load_mission(path)) == ()
    with path.open("a") as file:
        file.write("objects: {cup_2: {on: kitchen_table, at_m: [0.3, 0.0]}}\n")
    [sentence] = out_of_reach(load_mission(path))
    assert sentence.startswith(
        "cup_2 lies on kitchen_table at [0.3, 0.0], where no hand gets to: for hsr, it must stand "
        "0.43 to 0.55 m away, and there is room only 0.6"
    )
    only_drives = tmp_path / "only.yaml"
    only_drives.write_text(path.read_text().replace(str(HSR), str(HSR.with_name("locobot.yaml"))))
    assert out_of_reach(load_mission(only_drives)) == ()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            set_at("furniture", "charger", "yaw_deg", to=90.0),
            "no robot gets to charger, a charger: leave 0.6 m of floor before its front",
        ),
        (
            set_at("furniture", "sofa", to=SOFA_IN_THE_DOOR),
            "no robot gets from where it starts to kitchen: is a door lacking, or does something "
            "stand in one?",
        ),
    ],
)
def test_chargers_and_places_that_no_robot_gets_to_are_told(
    changed: Any, tmp_path: Path, change: Any, said: str
) -> None:
    path = mission(tmp_path, f"  - {{spec: {HSR}, start: {{at_m: [8.0, 3.0]}}}}\n")
    path.write_text(path.read_text().replace(str(HOME), str(changed(change))))
    assert out_of_reach(load_mission(path)) == (said,)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            "  wall: {kind: cupboard, place: kitchen, center_m: [2, 2], size_m: [0.3, 0.5, 0.8]}",
            r"furniture.wall.size_m: .*too small for a cupboard; it needs \[0.4, 0.3, 0.4\]",
        ),
        (
            "  low: {kind: fridge, place: kitchen, center_m: [2, 2], size_m: [0.6, 0.6, 0.5]}",
            "furniture.low.plinth_m: 0.3 leaves 0.20 m inside; a hand needs 0.35 m",
        ),
        (
            "  hob: {kind: counter, place: kitchen, center_m: [2, 2], size_m: [0.6, 0.6, 0.7], "
            "process: {state: temperature, value: hot, after_s: 3}}",
            "furniture.hob.process: nothing starts it; add `switch: true`",
        ),
        (
            "people: {ben: {at_m: [20, 1]}}",
            r"people.ben.at_m: \[20.0, 1.0\] is in none of the places",
        ),
        (
            "states: {kitchen_table: {is_open: true}}",
            "states.kitchen_table.is_open: it does not open; there are none",
        ),
        ("states: {moon: {is_on: true}}", "states.moon: there is no such thing in this world"),
    ],
)
def test_furniture_people_and_states_that_cannot_be_are_one_clear_sentence(
    tmp_path: Path, change: str, said: str
) -> None:
    text = HOME.read_text()
    if change.startswith("  "):
        text = text.replace("furniture:\n", f"furniture:\n{change}\n")
    else:
        text += change + "\n"
    path = tmp_path / "world.yaml"
    path.write_text(text)
    with pytest.raises(BadFile, match=said) as caught:
        load_world(path)
    assert "\n" not in str(caught.value)


def test_an_object_says_once_what_it_is_on_or_in(tmp_path: Path) -> None:
    path = tmp_path / "world.yaml"
    path.write_text(HOME.read_text().replace("on: kitchen_table,", "", 1))
    with pytest.raises(BadFile, match=r"objects\.cup_1: say either `on` or `in`"):
        load_world(path)


def test_the_apartment_is_furnished_and_everything_in_it_is_in_reach() -> None:
    mission = load_mission("apartment")
    world = mission.world
    assert (len(world.place_entries), len(world.furniture), len(world.object_entries)) == (
        5,
        26,
        40,
    )
    assert len({robot.spec.model for robot in mission.robots}) == 4
    assert out_of_reach(mission) == ()
    for place in place_payloads(world):
        assert set(place.travel_m) == set(world.place_entries) - {place.place}


PARTS = {
    "flat": {"label": "Flat", "region_m": [[0.0, 0.0, 10.0, 6.0]]},
    "corner": {"label": "Corner", "part_of": "kitchen", "region_m": [[0.0, 3.6, 4.0, 6.0]]},
}


def test_places_have_parts_and_what_stands_there_is_in_all_of_them(changed: Any) -> None:
    def change(raw: dict[str, Any]) -> None:
        raw["places"] = {**PARTS, **raw["places"]}
        for room in ("kitchen", "hallway", "living_room"):
            raw["places"][room]["part_of"] = "flat"
        raw["furniture"]["kitchen_table"]["place"] = "corner"

    world = load_world(changed(change))
    assert [world.place_at(1.0, y) for y in (5.0, 1.0)] == ["corner", "kitchen"]
    assert world.places_around("corner") == ("corner", "kitchen", "flat")
    places = {place.place: place for place in place_payloads(world)}
    assert {name: place.part_of for name, place in places.items()} == {
        "flat": None,
        "corner": "kitchen",
        "kitchen": "flat",
        "hallway": "flat",
        "living_room": "flat",
    }
    tables = {name: [s.surface for s in place.surfaces] for name, place in places.items()}
    assert tables["corner"] == tables["kitchen"] == ["kitchen_table"]
    assert set(tables["flat"]) == {"kitchen_table", "hallway_table", "coffee_table"}
    spots = Spots(world).waiting
    assert spots["corner"] and set(spots["corner"]) < set(spots["kitchen"]) < set(spots["flat"])


@pytest.mark.parametrize(
    ("place", "whole", "said"),
    [
        (
            "corner",
            "cellar",
            r"corner\.part_of: there is no place 'cellar'; there are flat, ",
        ),
        ("kitchen", "corner", r"part_of: \w+ would be a part of itself"),
        ("flat", "flat", r"places\.flat\.part_of: flat would be a part of itself"),
        ("corner", "hallway", r"corner\.part_of: the middle of \[0\.0, .*\] is not in 'hallway'"),
    ],
)
def test_a_part_that_cannot_be_is_one_clear_sentence(
    changed: Any, place: str, whole: str, said: str
) -> None:
    def change(raw: dict[str, Any]) -> None:
        raw["places"] = {**PARTS, **raw["places"]}
        raw["places"][place] = {**raw["places"][place], "part_of": whole}

    with pytest.raises(BadFile, match=said):
        load_world(changed(change))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            "c: {kind: cup, on: floor, at_m: [0.35, 4.7]}",
            r"c.at_m: c sticks \d.\d cm into kitc",
        ),
        ("c: {kind: cup, on: floor, at_m: [4.0, 1.0]}", r"c sticks 8.5 cm into wall 0; move one"),
        ("c: {kind: cup, on: floor, at_m: [0.02, 3.0]}", r"c sticks 1.5 cm into wall west"),
        ("b: {kind: box, on: floor, at_m: [2.0, 1.0], yaw_deg: 45}", None),
        (
            "c: {kind: cup, on: floor, at_m: [2, 1]}\n  b: {kind: box, on: floor, at_m: [2.1, 1]}",
            "objects.b.at_m: b sticks 3.5 cm into c",
        ),
        (  # long things side by side have room
            "b: {kind: box, on: kitchen_table, at_m: [0.4, 0.0], yaw_deg: 90}\n"
            "  d: {kind: box, on: kitchen_table, at_m: [0.52, 0.0], yaw_deg: 90}",
            None,
        ),
        (
            "b: {kind: box, on: kitchen_table, at_m: [0.3, 0.0], yaw_deg: 45}\n"
            "  d: {kind: box, on: kitchen_table, at_m: [0.38, 0.08], yaw_deg: -45}",
            r"d sticks \d\.\d cm into b",
        ),
        (
            "b: {kind: bin, on: floor, at_m: [2, 1]}\n  c: {kind: cup, in: b, at_m: [0.03, 0]}",
            "c sticks 2.0 cm into the wall of b, which it is in",
        ),
        ("b: {kind: bin, on: floor, at_m: [2, 1]}\n  c: {kind: cup, in: b}", None),
        ("t: {kind: tall, in: cabinet}", "t is 60.0 cm high, and cabinet has room for 48.0 cm"),
        ("c: {kind: cup, on: lone, at_m: [-0.2, 0.0]}", r"c sticks \d\.\d cm into cabinet"),
        (
            "c: {kind: cup, on: kitchen_table, at_m: [0.7, 0.0]}",
            "c sticks out 3.5 cm over the rim",
        ),
        (
            "b: {kind: box, on: kitchen_table, at_m: [0.0, 0.31], yaw_deg: 30}",
            r"b sticks out \d\.\d cm over the rim of kitchen_table in y; keep it within 0\.2",
        ),
    ],
)
def test_what_physics_would_throw_or_sink_is_refused_before(
    tmp_path: Path, change: str, said: str | None
) -> None:
    path = tmp_path / "world.yaml"
    text = HOME.read_text().replace("objects:\n", f"objects:\n  {change}\n")
    kinds = (
        "  box: {shape: box, size_m: [0.2, 0.1, 0.1], mass_kg: 0.3}\n"
        "  bin: {shape: bowl, radius_m: 0.05, height_m: 0.1, mass_kg: 0.3}\n"
        "  tall: {shape: cylinder, radius_m: 0.05, height_m: 0.6, mass_kg: 0.3}\n"
    )
    standing = (
        "  cabinet: {kind: cupboard, place: kitchen, center_m: [2, 4], size_m: [0.6, 0.5, 0.8]}\n"
        "  lone: {kind: table, place: kitchen, center_m: [2.5, 4.0], size_m: [0.6, 0.5, 0.6]}\n"
    )
    text = text.replace("object_kinds:\n", f"object_kinds:\n{kinds}")
    path.write_text(text.replace("furniture:\n", f"furniture:\n{standing}"))
    if said is None:
        assert load_world(path)
        return
    with pytest.raises(BadFile, match=said):
        load_world(path)


def test_doors_are_in_walls_and_robots_get_through_them(changed: Any, tmp_path: Path) -> None:
    off = changed(set_at("doors", "kitchen_door", "center_m", to=[3.6, 3.0]))
    with pytest.raises(BadFile, match=r"kitchen_door\.center_m: .* on no wall; the nearest"):
        load_world(off)
    narrow = changed(set_at("doors", "kitchen_door", "width_m", to=0.45))
    path = tmp_path / "m.yaml"
    robots = f"robots:\n  - {{spec: {HSR}, start: {{at_m: [8, 3]}}}}\n"
    path.write_text(f"mission: m\nworld: {narrow}\n{robots}")
    with pytest.raises(
        BadFile, match=r"line 2: world: the door kitchen_door is 0.45 m wide, .* 15 cm"
    ):
        load_mission(path)
    path.write_text(
        f"mission: m\nworld: {HOME}\n{robots}objects: {{cup_1: {{on: floor, at_m: [7.8, 3.0]}}}}\n"
    )
    with pytest.raises(BadFile, match=r"it stands 8.5 cm into cup_1, which lies on the floor"):
        load_mission(path)


def test_ways_say_which_doors_and_places_they_pass() -> None:
    """The flat's kitchen has a door to the hallway, and one to the living room."""
    places = {place.place: place for place in place_payloads(load_world("apartment"))}
    kitchen = places["kitchen"]
    to = {(way.to, way.through): way.length_m for way in kitchen.ways}
    assert to["living_room", ("serving_door",)] == kitchen.travel_m["living_room"]
    around = ("living_room", "living_room_door", "serving_door")
    assert to["hallway", around] == kitchen.travel_m["hallway"] < to["hallway", ("kitchen_door",)]
    shut = open_ways_m(places, {"serving_door"}, "kitchen")
    assert shut["hallway"] == to["hallway", ("kitchen_door",)]
    assert "hallway" not in open_ways_m(places, {"kitchen_door", "serving_door"}, "kitchen")
    assert set(open_ways_m(places, {"hallway"}, "kitchen")) == {"kitchen", "living_room"}


def test_doors_and_zones_are_regions_and_their_names_are_taken() -> None:
    world = load_world("apartment")
    regions = {region.region: region for region in region_payloads(world)}
    assert regions["kitchen_door"].region_m == (pytest.approx((2.1, 5.25, 3.1, 5.35)),)
    assert regions["serving_door"].region_m == (pytest.approx((5.15, 6.0, 5.25, 7.0)),)
