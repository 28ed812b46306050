"""A building of rooms along a corridor, with 1 m doors."""

from __future__ import annotations

from sim.files.world_schema import DoorEntry, PlaceEntry, WallEntry, WorldFile

ROOM_M = (6.0, 5.0)
CORRIDOR_M = 2.4
DOOR_M = 1.0


def building(rooms: int) -> WorldFile:
    """`rooms` on each side of a corridor, each with one door to it."""
    width, depth = ROOM_M
    length, total = rooms * width, 2 * depth + CORRIDOR_M
    low, high = depth, depth + CORRIDOR_M
    places = {"corridor": PlaceEntry(label="Corridor", region_m=((0.0, low, length, high),))}
    walls = [
        WallEntry(from_m=(0.0, low), to_m=(length, low)),
        WallEntry(from_m=(0.0, high), to_m=(length, high)),
    ]
    doors = {}
    for side, (wall_m, rect) in {"s": (low, (0.0, depth)), "n": (high, (high, total))}.items():
        for number in range(rooms):
            name, x = f"room_{side}{number}", number * width
            places[name] = PlaceEntry(label=name, region_m=((x, rect[0], x + width, rect[1]),))
            doors[f"door_{side}{number}"] = DoorEntry(
                between=(name, "corridor"), center_m=(x + width / 2, wall_m), width_m=DOOR_M
            )
            if number:
                walls.append(WallEntry(from_m=(x, rect[0]), to_m=(x, rect[1])))
    return WorldFile(
        world="building",
        size_m=(length, total),
        place_entries=places,
        walls=tuple(walls),
        doors=doors,
    )
