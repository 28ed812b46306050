"""Names for tests of sentences: rooms with tables, cups, a book, a fridge, two robots."""

from __future__ import annotations

from fleet.language import Reading, Vocabulary
from keyexpr_schema.payloads.world import Object, Place, Surface
from tests.support.household import carrier, manipulator


def _table(name: str) -> Surface:
    return Surface(surface=name, x_m=0, y_m=0, z_m=0.6, yaw_rad=0, length_m=1, width_m=1)


PLACES = (
    Place(
        place="kitchen",
        label="Kitchen",
        aliases=("cooking area",),
        surfaces=(_table("kitchen_table"),),
    ),
    Place(place="living_room", label="Living room", surfaces=(_table("coffee_table"),)),
    Place(place="hallway", label="Hallway", surfaces=(_table("hallway_table"),)),
)
OBJECTS = (
    Object(object="cup_1", kind="cup", label="first cup", aliases=("red cup",), home="kitchen"),
    Object(
        object="cup_2", kind="cup", label="Cup 2", ordinal=2, aliases=("blue mug",), home="kitchen"
    ),
    Object(object="book", kind="book", label="Red book", home="living_room"),
    Object(object="fridge", kind="fridge", label="Fridge", movable=False),
)
ROBOTS = (manipulator(), carrier())
WORDS = Vocabulary(
    places={place.place: place for place in PLACES},
    objects={thing.object: thing for thing in OBJECTS},
    robots={spec.robot: spec for spec in ROBOTS},
)


def shown(reading: Reading) -> str:
    """`at(cup_1) = hallway; located(book) > held(cup_1|cup_2)`: `>` between stages."""
    return " > ".join(
        "; ".join(
            f"{c.relation}({'|'.join(c.subjects)})" + ("" if c.value is True else f" = {c.value}")
            for c in stage
        )
        for stage in reading.stages
    )
