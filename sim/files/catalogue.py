"""How each kind of furniture, and a person, is built from panels, doors, drawers and surfaces."""

from __future__ import annotations

import math
from collections.abc import Mapping

from keyexpr_schema.payloads.motions import PointM
from sim.files.fixtures import PANEL_M, Button, Carrier, Fixture, Fixtures, Look, Mover, Panel
from sim.files.furniture_schema import FurnitureEntry, PersonEntry

TOP_M = 0.03
LEG_HALF_M = 0.025
STANDOFF_M = 0.09
"""A handle's post stands so far before its door: a hand that turns against the door has room."""
DRAWER_STANDOFF_M = 0.06
"""And before its drawer, against which a hand does not turn."""
HANDLE_RADIUS_M = 0.008
HANDLE_HALF_M = 0.055
HANDLE_TOP_M = 0.06
"""From the middle of a handle to the upper edge of its door at least."""
HANDLE_MOST_M = 0.74
"""No handle is higher: hands get to 0.8 m."""
DOOR_OPEN_RAD = 2.0
DRAWER_OPEN_M = 0.40
"""So far that hands get to what is in it before the handles of the drawers above."""
DRAWER_KEPT_M = 0.06
"""At least so much of a drawer stays in its unit."""
DRAWER_DEEP_M = 0.15
PALM_M = (0.0, -0.34, 0.78)
"""Where a person holds out a hand: the middle of its palm."""
BUTTON_HALF_M = 0.025
DOCK_LEVEL_M = 0.12
"""How high a charger's contacts are."""
BEFORE_M = 0.1
"""How far before its front a robot meets them, with what it folds out."""


def build(furnished: Mapping[str, FurnitureEntry], people: Mapping[str, PersonEntry]) -> Fixtures:
    """All fixtures of a world file."""
    found = {name: furniture(name, entry) for name, entry in furnished.items()}
    return Fixtures(found | {name: person(name, entry) for name, entry in people.items()})


def drawer_name(unit: str, number: int) -> str:
    """What a drawer of a unit is called; 1 is the uppermost."""
    return f"{unit}_drawer_{number}"


def board_name(shelf: str, number: int) -> str:
    """What a board of a shelf is called; 1 is the uppermost."""
    return f"{shelf}_board_{number}"


def furniture(name: str, entry: FurnitureEntry) -> Fixture:
    """A piece of furniture."""
    hx, hy, height = entry.size_m[0] / 2, entry.size_m[1] / 2, entry.size_m[2]
    make = {
        "table": _table,
        "block": _block,
        "counter": _counter,
        "shelf": _shelf,
        "cupboard": _cupboard,
        "fridge": _cupboard,
        "drawers": _drawers,
        "sofa": _sofa,
        "bed": _bed,
        "sink": _sink,
        "lamp": _lamp,
        "switch": _switch,
        "charger": _charger,
    }[entry.kind]
    panels, movers, carriers, button_m = make(name, entry, hx, hy, height)
    button = None
    if entry.switch or entry.kind in ("lamp", "switch"):
        x, y, z = button_m
        button = Button(name, (x, y, z + 0.02))
        panels.append(Panel((x, y, z + 0.01), (BUTTON_HALF_M, BUTTON_HALF_M, 0.01), "metal"))
    reach = [
        max(
            -hy - mover.moved_m(mover.handle_m, share * mover.open_at)[1] for share in (0.0, 0.5, 1)
        )
        for mover in movers
    ]
    return Fixture(
        name=name,
        kind=entry.kind,
        center_m=entry.center_m,
        yaw_rad=math.radians(entry.yaw_deg),
        half_m=(hx, hy),
        height_m=height,
        panels=tuple(panels),
        movers=tuple(movers),
        carriers=tuple(carriers),
        button=button,
        rgba=entry.rgba,
        front_m=max(reach, default=0.0),
        dock_m=(0.0, -hy - BEFORE_M, DOCK_LEVEL_M) if entry.kind == "charger" else None,
    )


_Parts = tuple[list[Panel], list[Mover], list[Carrier], PointM]


def _top(hx: float, hy: float, height: float) -> PointM:
    """Where a button sits on something with a flat top: at its right front corner."""
    return (hx - 0.08, -hy + 0.08, height)


def _table(name: str, entry: FurnitureEntry, hx: float, hy: float, height: float) -> _Parts:
    half_top = min(TOP_M, height / 2) / 2
    half_leg = height / 2 - half_top
    panels = [Panel((0, 0, height - half_top), (hx, hy, half_top), "wood", main=True)]
    inset = 2 * LEG_HALF_M
    for sx in (-1, 1):
        for sy in (-1, 1):
            at = (sx * max(hx - inset, 0.0), sy * max(hy - inset, 0.0), half_leg)
            panels.append(Panel(at, (LEG_HALF_M, LEG_HALF_M, half_leg), "dark"))
    return panels, [], [Carrier(name, (0, 0, height), (2 * hx, 2 * hy, 1.0))], _top(hx, hy, height)


def _block(name: str, entry: FurnitureEntry, hx: float, hy: float, height: float) -> _Parts:
    panels = [Panel((0, 0, height / 2), (hx, hy, height / 2), "block", main=True)]
    return panels, [], [], _top(hx, hy, height)


def _counter(name: str, entry: FurnitureEntry, hx: float, hy: float, height: float) -> _Parts:
    half = (height - TOP_M) / 2
    panels = [
        Panel((0, 0, half), (hx - 0.01, hy - 0.01, half), "front", main=True),
        Panel((0, 0, height - TOP_M / 2), (hx, hy, TOP_M / 2), "metal"),
    ]
    return panels, [], [Carrier(name, (0, 0, height), (2 * hx, 2 * hy, 1.0))], _top(hx, hy, height)


def _shell(hx: float, hy: float, low: float, high: float, *, look: Look = "front") -> list[Panel]:
    """Sides and back of something whose front is open, from `low` to `high`."""
    half, t = (high - low) / 2, PANEL_M / 2
    z = low + half
    return [
        Panel((-hx + t, 0, z), (t, hy, half), look, main=True),
        Panel((hx - t, 0, z), (t, hy, half), look, main=True),
        Panel((0, hy - t, z), (hx - PANEL_M, t, half), look, main=True),
    ]


def _shelf(name: str, entry: FurnitureEntry, hx: float, hy: float, height: float) -> _Parts:
    """Boards between two sides; the uppermost is the top, and the lowest stands a little off."""
    t = PANEL_M / 2
    count = entry.boards
    panels = _shell(hx, hy, 0.0, height - PANEL_M, look="wood")
    low = 0.10
    pitch = (height - low) / (count - 1) if count > 1 else 0.0
    carriers = []
    for number in range(1, count + 1):
        top = height - (number - 1) * pitch
        first = number == 1
        half_x = hx if first else hx - PANEL_M
        panels.append(Panel((0, 0, top - t), (half_x, hy, t), "wood", main=True))
        size = (2 * half_x - 0.04, 2 * hy - 0.04, 1.0 if first else pitch - PANEL_M)
        carriers.append(Carrier(board_name(name, number), (0, -0.01, top), size, roofed=not first))
    return panels, [], carriers, _top(hx, hy, height)


def _cupboard(name: str, entry: FurnitureEntry, hx: float, hy: float, height: float) -> _Parts:
    low, t = entry.plinth_m, PANEL_M / 2
    panels = [
        Panel((0, 0, low / 2), (hx, hy, low / 2), "dark"),
        *_shell(hx, hy, low, height - PANEL_M),
        Panel((0, 0, height - t), (hx, hy, t), "front", main=True),
    ]
    free = height - PANEL_M - low
    inside = Carrier(
        name, (0, -0.01, low), (2 * hx - 0.06, 2 * hy - 0.05, free), inside=True, roofed=True
    )
    right = entry.hinge == "right"
    side = 1.0 if right else -1.0
    half = (height - low) / 2
    y = -hy - t
    handle = (
        -side * (hx - 0.05),
        -hy - PANEL_M - STANDOFF_M,
        min(height - HANDLE_TOP_M, HANDLE_MOST_M),
    )
    door = Mover(
        thing=name,
        joint="hinge",
        anchor_m=(side * hx, -hy, low + half),
        axis=(0.0, 0.0, side),
        open_at=DOOR_OPEN_RAD,
        panels=(
            Panel((0, y, low + half), (hx - 0.002, t - 0.001, half - 0.003), "front", main=True),
            *_handle(handle, STANDOFF_M),
        ),
        handle_m=handle,
    )
    return panels, [door], [inside], _top(hx, hy, height)


def _handle(middle_m: PointM, standoff_m: float) -> tuple[Panel, ...]:
    """An upright post, and the two stays that it is drawn with."""
    x, y, z = middle_m
    stay = standoff_m / 2
    return (
        Panel(middle_m, (HANDLE_RADIUS_M, HANDLE_HALF_M, 0), "metal", "cylinder"),
        *(
            Panel((x, y + stay, z + up), (0.006, stay, 0.006), "metal", hollow=True)
            for up in (-HANDLE_HALF_M + 0.006, HANDLE_HALF_M - 0.006)
        ),
    )


def _drawers(name: str, entry: FurnitureEntry, hx: float, hy: float, height: float) -> _Parts:
    t, count = PANEL_M / 2, entry.drawers
    low, high = 0.06, height - TOP_M
    pitch = (high - low) / count
    panels = [
        Panel((0, 0, low / 2), (hx, hy - 0.02, low / 2), "dark"),
        *_shell(hx, hy, low, high, look="wood"),
        Panel((0, 0, height - TOP_M / 2), (hx, hy, TOP_M / 2), "wood", main=True),
    ]
    movers = []
    inner_x, deep = hx - PANEL_M - 0.01, hy - PANEL_M - 0.01
    for number in range(1, count + 1):
        thing = drawer_name(name, number)
        bottom = high - number * pitch
        # No deeper below its front's edge than a hand gets in over that.
        floor = bottom + max(0.02, pitch - DRAWER_DEEP_M)
        half_wall = min((bottom + pitch - floor) / 2 - 0.02, 0.04)
        # A hand comes from above, with its arm to the left: lower handles are farther left.
        aside = ((count + 1) / 2 - number) * min(0.2, (2 * hx - 0.2) / count)
        handle = (aside, -hy - PANEL_M - DRAWER_STANDOFF_M, bottom + pitch / 2)
        wall_z = floor + half_wall
        movers.append(
            Mover(
                thing=thing,
                joint="slide",
                anchor_m=(0.0, 0.0, wall_z),
                axis=(0.0, -1.0, 0.0),
                open_at=min(DRAWER_OPEN_M, 2 * hy - DRAWER_KEPT_M),
                panels=(
                    Panel(
                        (0, -hy - t, bottom + pitch / 2),
                        (hx - 0.004, t, pitch / 2 - 0.004),
                        "front",
                        main=True,
                    ),
                    Panel((0, -0.005, floor - 0.005), (inner_x, deep, 0.005), "wood"),
                    Panel((-inner_x + 0.005, -0.005, wall_z), (0.005, deep, half_wall), "wood"),
                    Panel((inner_x - 0.005, -0.005, wall_z), (0.005, deep, half_wall), "wood"),
                    Panel((0, deep - 0.01, wall_z), (inner_x, 0.005, half_wall), "wood"),
                    *_handle(handle, DRAWER_STANDOFF_M),
                ),
                handle_m=handle,
                carriers=(
                    Carrier(
                        thing,
                        (0, -0.005, floor),
                        (2 * inner_x - 0.02, 2 * deep - 0.02, bottom + pitch - floor),
                        inside=True,
                    ),
                ),
            )
        )
    top = Carrier(name, (0, 0, height), (2 * hx, 2 * hy, 1.0))
    return panels, movers, [top], _top(hx, hy, height)


def _sofa(name: str, entry: FurnitureEntry, hx: float, hy: float, height: float) -> _Parts:
    seat, arm, back = 0.45 * height if height > 0.6 else 0.9 * height, 0.12, 0.2
    panels = [
        Panel((0, 0, seat / 2), (hx, hy, seat / 2), "soft", main=True),
        Panel((0, hy - back / 2, height / 2), (hx, back / 2, height / 2), "soft", main=True),
    ]
    panels += [
        Panel(
            (side * (hx - arm / 2), 0, (seat + 0.12) / 2),
            (arm / 2, hy, (seat + 0.12) / 2),
            "soft",
            main=True,
        )
        for side in (-1, 1)
    ]
    size = (2 * (hx - arm), 2 * hy - back, 1.0)
    return panels, [], [Carrier(name, (0, -back / 2, seat), size)], _top(hx, hy, seat)


def _bed(name: str, entry: FurnitureEntry, hx: float, hy: float, height: float) -> _Parts:
    frame = 0.55 * height
    pillow = (hx * 0.7, 0.18, 0.04)
    panels = [
        Panel((0, 0, frame / 2), (hx, hy, frame / 2), "dark"),
        Panel((0, 0, (frame + height) / 2), (hx - 0.02, hy - 0.02, (height - frame) / 2), "soft"),
        Panel((0, hy - 0.02, height / 2 + 0.2), (hx, 0.02, height / 2 + 0.2), "dark"),
        Panel((0, hy - 0.26, height + 0.04), pillow, "front"),
    ]
    panels[1] = Panel(panels[1].center_m, panels[1].half_m, "soft", main=True)
    carrier = Carrier(name, (0, -0.25, height), (2 * hx - 0.04, 2 * hy - 0.54, 1.0))
    return panels, [], [carrier], _top(hx, hy, height)


def _sink(name: str, entry: FurnitureEntry, hx: float, hy: float, height: float) -> _Parts:
    deep, rim = 0.12, 0.06
    back = 0.12
    floor = height - deep
    panels = [
        Panel((0, 0, floor / 2), (hx, hy, floor / 2), "front", main=True),
        Panel((0, -hy + rim / 2, height - deep / 2), (hx, rim / 2, deep / 2), "metal"),
        Panel((0, hy - back / 2, height - deep / 2), (hx, back / 2, deep / 2), "metal"),
    ]
    side = max(0.14, rim)
    inner_y = (-hy + rim, hy - back)
    mid_y, half_y = sum(inner_y) / 2, (inner_y[1] - inner_y[0]) / 2
    panels += [
        Panel(
            (s * (hx - side / 2), mid_y, height - deep / 2), (side / 2, half_y, deep / 2), "metal"
        )
        for s in (-1, 1)
    ]
    panels += [
        Panel((0, hy - 0.06, height + 0.11), (0.012, 0.11, 0), "metal", "cylinder", hollow=True),
        Panel((0, hy - 0.12, height + 0.21), (0.01, 0.07, 0.01), "metal", hollow=True),
    ]
    size = (2 * (hx - side), 2 * half_y, deep + 0.1)
    basin = Carrier(name, (0, mid_y, floor), size, inside=True)
    return panels, [], [basin], (hx - side / 2, mid_y, height)


def _lamp(name: str, entry: FurnitureEntry, hx: float, hy: float, height: float) -> _Parts:
    """A standard lamp, with its button on a bracket, clear of the shade."""
    foot, at, out = min(hx, hy), 0.60, 0.22
    panels = [
        Panel((0, 0, 0.015), (foot, 0.015, 0), "dark", "cylinder"),
        Panel((0, 0, height / 2), (0.015, height / 2, 0), "metal", "cylinder"),
        Panel((0, 0, height - 0.11), (0.15, 0.11, 0), "light", "cylinder", main=True),
        Panel((0, -out / 2, at - 0.01), (0.012, out / 2, 0.01), "metal"),
        Panel((0, -out, at - 0.01), (0.035, 0.035, 0.01), "dark"),
    ]
    return panels, [], [], (0.0, -out, at)


def _switch(name: str, entry: FurnitureEntry, hx: float, hy: float, height: float) -> _Parts:
    half = (height - 0.02) / 2
    return [Panel((0, 0, half), (hx, hy, half), "front", main=True)], [], [], (0.0, 0.0, 2 * half)


def _charger(name: str, entry: FurnitureEntry, hx: float, hy: float, height: float) -> _Parts:
    """A column with a lamp, and two contacts that robots dock at from its front."""
    panels = [
        Panel((0, 0, height / 2), (hx, hy, height / 2), "front", main=True),
        Panel((0, 0, height - 0.03), (hx + 0.004, hy + 0.004, 0.012), "light", hollow=True),
    ]
    panels += [
        Panel((s * hx / 2, -hy, DOCK_LEVEL_M), (0.012, 0.006, 0.04), "metal", hollow=True)
        for s in (-1, 1)
    ]
    return panels, [], [], _top(hx, hy, height)


def person(name: str, entry: PersonEntry) -> Fixture:
    """A person who stands still and holds out a hand, looking along the fixture's -y."""
    x, y, z = PALM_M
    panels = (
        *(Panel((s * 0.09, 0, 0.42), (0.075, 0.42, 0), "dark", "cylinder") for s in (-1, 1)),
        *(Panel((s * 0.09, -0.05, 0.03), (0.05, 0.11, 0.03), "hair") for s in (-1, 1)),
        Panel((0, 0, 1.09), (0.19, 0.11, 0.26), "cloth", main=True),
        Panel((0, 0, 1.39), (0.05, 0.05, 0), "skin", "cylinder"),
        Panel((0, 0, 1.52), (0.11, 0, 0), "skin", "sphere"),
        Panel((0, 0.025, 1.56), (0.105, 0, 0), "hair", "sphere"),
        *(
            Panel((s * 0.04, -0.10, 1.54), (0.014, 0, 0), "hair", "sphere", hollow=True)
            for s in (-1, 1)
        ),
        Panel((-0.23, 0, 1.07), (0.045, 0.045, 0.24), "cloth", main=True),
        Panel((-0.23, 0, 0.79), (0.04, 0.04, 0.05), "skin"),
        # the arm that is held out, and its palm
        Panel((0.20, 0, 1.07), (0.045, 0.045, 0.22), "cloth", main=True),
        Panel((0.16, -0.10, 0.80), (0.045, 0.13, 0.04), "cloth", main=True),
        Panel((0.09, -0.22, z - 0.015), (0.10, 0.035, 0.015), "skin"),
        Panel((x, y, z - 0.01), (0.07, 0.10, 0.01), "skin"),
    )
    return Fixture(
        name=name,
        kind="person",
        center_m=entry.at_m,
        yaw_rad=math.radians(entry.yaw_deg) + math.pi / 2,
        half_m=(0.28, 0.20),
        height_m=1.6,
        panels=panels,
        carriers=(Carrier(name, PALM_M, (0.14, 0.20, 1.0)),),
        rgba=entry.rgba,
    )
