"""A furnished flat for tests of sentences: things on and in others, what opens, a person."""

from __future__ import annotations

from fleet.core.model.skills import phrases_of, state_words_of
from fleet.language import Vocabulary
from fleet.service.skill_models import load_skills
from keyexpr_schema.config_files import config_file
from keyexpr_schema.payloads.world import Object, Place
from tests.support.household import carrier, manipulator


def thing(name: str, *features: str, label: str = "", **more: object) -> Object:
    kind = name.rstrip("_12").split("_")[-1]
    given = {"object": name, "kind": kind, "label": label or name.replace("_", " "), **more}
    return Object(features=features, **given)  # type: ignore[arg-type]


THINGS = (
    thing("kitchen_table", "supports", movable=False, home="kitchen"),
    thing("coffee_table", "supports", movable=False, home="living_room"),
    thing("shelf", movable=False, home="living_room"),
    thing("shelf_board_1", "supports", movable=False, part_of="shelf", label="upper board"),
    thing("shelf_board_2", "supports", movable=False, part_of="shelf", label="lower board"),
    thing("fridge", "contains", "openable", movable=False, home="kitchen"),
    thing("cupboard", "contains", "openable", movable=False, home="kitchen"),
    thing("box", "contains", "supports"),
    thing("bowl", "contains"),
    thing("tray_1", "supports", label="tray", aliases=("serving tray",)),
    thing("television", "switchable", movable=False, home="living_room"),
    thing("lamp", "switchable", home="shelf_board_1"),
    thing("fork"),
    thing("cup_1", label="first cup", home="cupboard"),
    thing("cup_2", label="second cup", ordinal=2, home="cupboard"),
    thing("anna", "person", label="Anna"),
)
SKILLS = load_skills(config_file("skills", "household"))
FURNISHED = Vocabulary(
    places={
        name: Place(place=name, label=name.replace("_", " ").capitalize())
        for name in ("kitchen", "living_room", "hallway")
    },
    objects={each.object: each for each in THINGS},
    robots={spec.robot: spec for spec in (manipulator(), carrier())},
    whereabouts={
        "cup_1": "kitchen", "cup_2": "kitchen", "kitchen_table": "kitchen", "fridge": "kitchen",
        "cupboard": "kitchen", "coffee_table": "living_room", "shelf": "living_room",
        "anna": "living_room", "lamp": "living_room",
    },
    rests={"cup_1": "kitchen_table", "cup_2": "fridge", "lamp": "coffee_table"},
    carriers={
        "cup_1": ("kitchen_table", "kitchen"),
        "cup_2": ("fridge", "kitchen"),
        "lamp": ("coffee_table", "living_room"),
        "kitchen_table": ("kitchen",),
        "coffee_table": ("living_room",),
        "fridge": ("kitchen",),
        "cupboard": ("kitchen",),
        "shelf": ("living_room",),
        "anna": ("living_room",),
    },
    skill_phrases=phrases_of(SKILLS),
    state_words=state_words_of(SKILLS),
)  # fmt: skip
