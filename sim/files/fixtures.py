"""What furniture and people are made of: panels, doors and drawers, surfaces, handles, buttons.

A fixture has a frame of its own: the origin on the floor under its middle, x along its length, and
its front towards -y. Metres, kilograms. The two backends and the pictures read the same shapes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

from keyexpr_schema.payloads.motions import PointM
from sim.files.furniture_schema import Rgba

PANEL_M = 0.02
ROOF_M = 0.05
"""What is not deeper than this below the top of a piece of furniture lies on it."""
BEHIND_FRONT_M = 0.12

Look = Literal["wood", "dark", "front", "metal", "block", "soft", "light", "skin", "cloth", "hair"]
COLOURS: dict[Look, Rgba] = {
    "wood": (0.72, 0.53, 0.35, 1.0),
    "dark": (0.45, 0.33, 0.22, 1.0),
    "front": (0.93, 0.92, 0.88, 1.0),
    "metal": (0.55, 0.57, 0.60, 1.0),
    "block": (0.55, 0.62, 0.66, 1.0),
    "soft": (0.42, 0.52, 0.62, 1.0),
    "light": (1.0, 0.90, 0.60, 1.0),
    "skin": (0.87, 0.67, 0.53, 1.0),
    "cloth": (0.30, 0.42, 0.55, 1.0),
    "hair": (0.25, 0.18, 0.13, 1.0),
}


@dataclass(frozen=True)
class Panel:
    """A solid. `half_m`: box half-extents; cylinder (radius, half-height); sphere (radius).

    `main`: its colour is the furniture's own, where the file gives one. A `hollow` one is seen and
    not felt.
    """

    center_m: PointM
    half_m: PointM
    look: Look
    shape: Literal["box", "cylinder", "sphere"] = "box"
    main: bool = False
    hollow: bool = False


@dataclass(frozen=True)
class Carrier:
    """Where things can be on (or, `inside`, in) the thing `thing`, which is the fixture or a part.

    `center_m` is the middle of the level that they stand on, `size_m` (along x, along y, free
    height). `roofed`: a hand gets there from the front only.
    """

    thing: str
    center_m: PointM
    size_m: PointM
    inside: bool = False
    roofed: bool = False


@dataclass(frozen=True)
class Mover:
    """A door on a hinge or a drawer on a slide, as it is when closed; it opens the thing `thing`.

    `anchor_m` is on the hinge's axis; `axis` is a direction; `open_at` is the joint's value when it
    is open [m or rad].
    """

    thing: str
    joint: Literal["slide", "hinge"]
    anchor_m: PointM
    axis: PointM
    open_at: float
    panels: tuple[Panel, ...]
    handle_m: PointM
    carriers: tuple[Carrier, ...] = ()

    def moved_m(self, point_m: PointM, value: float) -> PointM:
        """Where a point of it gets to when the joint is at `value`, in the fixture's frame."""
        x, y, z = point_m
        if self.joint == "slide":
            return (
                x + self.axis[0] * value,
                y + self.axis[1] * value,
                z + self.axis[2] * value,
            )
        turn = value * self.axis[2]
        c, s = math.cos(turn), math.sin(turn)
        dx, dy = x - self.anchor_m[0], y - self.anchor_m[1]
        return (self.anchor_m[0] + c * dx - s * dy, self.anchor_m[1] + s * dx + c * dy, z)


@dataclass(frozen=True)
class Button:
    """What switches the thing `thing` when it is touched from above; `top_m` is its upper side."""

    thing: str
    top_m: PointM


@dataclass(frozen=True)
class Fixture:
    """One piece of furniture, or a person, where it stands. `half_m` is its footprint (x, y)."""

    name: str
    kind: str
    center_m: tuple[float, float]
    yaw_rad: float
    half_m: tuple[float, float]
    height_m: float
    panels: tuple[Panel, ...]
    movers: tuple[Mover, ...] = ()
    carriers: tuple[Carrier, ...] = ()
    button: Button | None = None
    rgba: Rgba | None = None
    front_m: float = 0.0
    """How far its doors and drawers reach out when they are open."""
    dock_m: PointM | None = None
    """Where a docked robot meets a charger's contacts, in its frame: just before its front."""

    def point_m(self, local_m: PointM) -> PointM:
        """A point of its frame in the world frame."""
        c, s = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        x, y, z = local_m
        return (self.center_m[0] + c * x - s * y, self.center_m[1] + s * x + c * y, z)

    def local_m(self, point_m: PointM) -> PointM:
        """A point of the world frame in its frame."""
        c, s = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        dx, dy = point_m[0] - self.center_m[0], point_m[1] - self.center_m[1]
        return (c * dx + s * dy, c * dy - s * dx, point_m[2])

    @property
    def inward_rad(self) -> float:
        """The heading of who stands before its front and looks at it."""
        return math.remainder(self.yaw_rad + math.pi / 2, math.tau)

    def roofs(self, point_m: PointM) -> bool:
        """Whether a point of the world frame is in it below its roof: reached from its front."""
        x, y, z = self.local_m(point_m)
        return (
            any(carrier.roofed for carrier in self.all_carriers)
            and abs(x) < self.half_m[0]
            and abs(y) < self.half_m[1]
            and z < self.height_m - ROOF_M
        )

    def mover(self, thing: str) -> Mover | None:
        """What opens `thing`."""
        return next((mover for mover in self.movers if mover.thing == thing), None)

    def drawers_above(self, thing: str) -> tuple[str, ...]:
        """Those that keep hands, which come from above, from a drawer while they are open."""
        mover = self.mover(thing)
        if mover is None:
            return ()
        return tuple(
            other.thing
            for other in self.movers
            if other.joint == "slide" and other.handle_m[2] > mover.handle_m[2]
        )

    @property
    def all_carriers(self) -> tuple[Carrier, ...]:
        """Those that stay, and those that move with a door or a drawer (as they are closed)."""
        return (*self.carriers, *(c for mover in self.movers for c in mover.carriers))

    def colour(self, panel: Panel) -> Rgba:
        """What colour a panel has."""
        return self.rgba if panel.main and self.rgba is not None else COLOURS[panel.look]


@dataclass(frozen=True)
class Fixtures:
    """All fixtures of a world, in the order of its file, people last."""

    by_name: dict[str, Fixture]

    @cached_property
    def carriers(self) -> dict[str, tuple[Fixture, Carrier]]:
        """Where things can be on or in a fixture or a part of one, by the name of that."""
        return {
            carrier.thing: (fixture, carrier)
            for fixture in self.by_name.values()
            for carrier in fixture.all_carriers
        }

    @cached_property
    def movers(self) -> dict[str, tuple[Fixture, Mover]]:
        """What opens, by the name of the thing that is open or closed by it."""
        return {
            mover.thing: (fixture, mover)
            for fixture in self.by_name.values()
            for mover in fixture.movers
        }

    @cached_property
    def buttons(self) -> dict[str, tuple[Fixture, Button]]:
        """What is touched to switch something, by the name of what it switches."""
        return {
            fixture.button.thing: (fixture, fixture.button)
            for fixture in self.by_name.values()
            if fixture.button is not None
        }

    @cached_property
    def chargers(self) -> dict[str, Fixture]:
        """What robots charge at."""
        return {name: each for name, each in self.by_name.items() if each.dock_m is not None}

    def roof_over(self, point_m: PointM) -> Fixture | None:
        """The fixture that a point of the world frame is in, below its roof; `None`: none."""
        return next((each for each in self.by_name.values() if each.roofs(point_m)), None)

    def moved_m(self, thing: str, local_m: PointM, opening: float) -> PointM:
        """A point of the fixture that `thing` belongs to, in the world frame.

        If it lies on what moves when `thing` opens, it moves along; `opening` is 0 (closed) to 1.
        """
        fixture, mover = self.movers[thing]
        return fixture.point_m(mover.moved_m(local_m, opening * mover.open_at))

    def face_m(self, thing: str, opening: float) -> PointM:
        """The point of a fixture or a part that one comes up to in order to see how it is: where
        things are in it, a little behind its front; else the middle of its footprint."""
        if thing in self.carriers:
            carrier = self.carriers[thing][1]
            across = min(0.0, BEHIND_FRONT_M - carrier.size_m[1] / 2) if carrier.roofed else 0.0
            return self.carrier_point_m(thing, 0.0, across, opening)
        return (*self.by_name[thing].center_m, 0.0)

    def carrier_point_m(
        self, thing: str, along_m: float, across_m: float, opening: float = 0.0
    ) -> PointM:
        """A point on (in) a fixture, given from the middle of where things stand, world frame."""
        fixture, carrier = self.carriers[thing]
        x, y, z = carrier.center_m
        local = (x + along_m, y + across_m, z)
        mover = fixture.mover(thing)
        if mover is not None and carrier in mover.carriers:
            local = mover.moved_m(local, opening * mover.open_at)
        return fixture.point_m(local)
