"""What a world file says of furniture and people, as types. Metres, world frame."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec

from keyexpr_schema.facts import Value
from keyexpr_schema.ids import Id
from sim.files.yaml_file import FileEntry

Positive = Annotated[float, msgspec.Meta(gt=0.0)]
LARGEST_SIDE_M = 250.0
"""No building is longer: the grid that robots' ways are found on takes memory with its area."""
Coordinate = Annotated[float, msgspec.Meta(ge=-LARGEST_SIDE_M, le=LARGEST_SIDE_M)]
Side = Annotated[float, msgspec.Meta(ge=1.0, le=LARGEST_SIDE_M)]
PointXY = tuple[Coordinate, Coordinate]
Degrees = Annotated[float, msgspec.Meta(ge=-360.0, le=360.0)]
FurnitureLength = Annotated[float, msgspec.Meta(ge=0.01, le=50.0)]
ThingLength = Annotated[float, msgspec.Meta(ge=0.001, le=5.0)]
ThingMass = Annotated[float, msgspec.Meta(ge=0.0001, le=200.0)]
"""What can be moved: from a pill to a washing machine."""
Share = Annotated[float, msgspec.Meta(ge=0.0, le=1.0)]
Rgba = tuple[Share, Share, Share, Share]


class ProcessEntry(FileEntry, frozen=True):
    """What happens to things in or on something after it has been on (and closed) for a while.

    Physics knows neither heat nor water: after `after_s` the state `state` of each is `value`.
    """

    state: Id
    value: Value
    after_s: Positive


FurnitureKind = Literal[
    "table",
    "block",
    "counter",
    "shelf",
    "cupboard",
    "fridge",
    "drawers",
    "sofa",
    "bed",
    "sink",
    "lamp",
    "switch",
    "charger",
]


class FurnitureEntry(FileEntry, frozen=True):
    """A piece of furniture: `sim.files.fixtures` says what each kind is made of.

    `size_m` is (length along its own x, width along its own y, height); its front is the side
    towards -y. `boards` of a shelf, `drawers` of a unit of drawers, `plinth_m` (the level inside)
    and `hinge` (as seen from the front) of a cupboard or fridge. `switch`: it has a button, too.
    """

    kind: FurnitureKind
    place: Id
    center_m: PointXY
    size_m: tuple[FurnitureLength, FurnitureLength, FurnitureLength]
    yaw_deg: Degrees = 0.0
    label: str = ""
    aliases: tuple[str, ...] = ()
    called: Id | None = None
    """What its kind is called, if not as here: an `oven` is a cupboard with a switch."""
    categories: tuple[str, ...] = ()
    features: tuple[str, ...] = ()
    properties: dict[str, Value] = {}
    room: Positive | None = None
    rgba: Rgba | None = None
    boards: Annotated[int, msgspec.Meta(ge=1, le=6)] = 3
    drawers: Annotated[int, msgspec.Meta(ge=1, le=4)] = 2
    plinth_m: Annotated[float, msgspec.Meta(ge=0.05)] = 0.30
    hinge: Literal["left", "right"] = "left"
    switch: bool = False
    process: ProcessEntry | None = None


class PersonEntry(FileEntry, frozen=True):
    """Somebody who stands at `at_m`, looks along `yaw_deg` and holds out a hand for things."""

    at_m: PointXY
    yaw_deg: Degrees = 0.0
    label: str = ""
    aliases: tuple[str, ...] = ()
    rgba: Rgba | None = None
