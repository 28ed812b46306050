"""What is next to or between other things: it tells things apart, and is wanted where it can be."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fleet.core.model.skill_file import skills_from_data
from fleet.core.model.skills import relations_of_skills
from fleet.errors import NotUnderstood
from fleet.language import Vocabulary, read
from keyexpr_schema.facts import FactKey
from keyexpr_schema.payloads.world import Object, Place, Surface
from tests.support.household import carrier, manipulator
from tests.support.language_flat_said import told


def surface(name: str, x_m: float, y_m: float = 0.0) -> Surface:
    return Surface(surface=name, x_m=x_m, y_m=y_m, z_m=0.7, yaw_rad=0, length_m=1, width_m=1)


def thing(name: str, *features: str) -> Object:
    kind, _, number = name.partition("_")
    label = name.replace("_", " ")
    return Object(object=name, kind=kind, label=label, features=features, ordinal=int(number or 1))


FURNITURE = ("desk_1", "desk_2", "desk_3", "sofa", "shelf")
CARRIERS = {
    "cup_1": ("desk_1", "study"),
    "cup_2": ("desk_3", "study"),
    "lamp": ("desk_1", "study"),
    "plant": ("shelf", "study"),
    **dict.fromkeys(FURNITURE, ("study",)),
}
STUDY = Vocabulary(
    places={
        "kitchen": Place(place="kitchen", label="kitchen"),
        "study": Place(
            place="study",
            label="study",
            surfaces=tuple(
                surface(name, x_m)
                for name, x_m in (("desk_1", 0), ("sofa", 1.5), ("desk_2", 3), ("desk_3", 7.5),
                                  ("shelf", 9))
            ),
        ),
    },
    objects={
        **{name: thing(name, "supports") for name in FURNITURE},
        **{name: thing(name, "movable") for name in ("cup_1", "cup_2", "lamp", "plant", "pen")},
    },
    robots={"hsr": manipulator(), "locobot": carrier()},
    whereabouts=dict.fromkeys(CARRIERS, "study"),
    rests={name: above[0] for name, above in CARRIERS.items() if len(above) > 1},
    carriers=CARRIERS,
)  # fmt: skip
BESIDE = skills_from_data(
    {
        "relations": {"next_to": {"of": "movable", "values": "object"}},
        "skills": {
            "place_beside": {
                "about": "Put it beside another thing.",
                "parameters": {"robot": "robot", "object": "movable", "other": "object"},
                "needs": {"robot": ["grip"]},
                "before": ["holding(robot) = object"],
                "after": ["holding(robot) = nothing", "next_to(object) = other"],
                "duration_s": 20,
            }
        },
    },
    "beside.yaml",
)
ABLE = replace(STUDY, relations=relations_of_skills(BESIDE))


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("bring the cup next to the lamp to the kitchen", "at(cup_1) = kitchen"),
        ("Put the cup beside the plant in the kitchen", "at(cup_2) = kitchen"),
        ("put the cup that is near the lamp in the kitchen", "at(cup_1) = kitchen"),
        ("put the cup that is not next to the lamp in the kitchen", "at(cup_2) = kitchen"),
        ("Find the cup next to the lamp", "located(cup_1) = true"),
        ("pick up the cup close to the plant", "held(cup_2) = true"),
        ("put the pen on the desk next to the shelf", "on(pen) = desk_3"),
        ("put the pen on the desk between the sofa and the shelf", "asks"),
        ("put the lamp on the desk between the sofa and desk 3", "on(lamp) = desk_2"),
        ("bring the cup next to the lamp and the cup next to the plant to the kitchen",
         "at(cup_1) = kitchen and at(cup_2) = kitchen"),
    ],
)  # fmt: skip
def test_what_is_around_a_thing_tells_it_apart(text: str, meant: str) -> None:
    assert told(read(text, STUDY)).startswith(meant)


def test_what_was_told_goes_for_all_relations() -> None:
    believed = {FactKey("under", "cup_2"): "sofa"}
    told_so = replace(STUDY, believed=believed)
    assert told(read("bring the cup under the sofa to the kitchen", told_so)) == (
        "at(cup_2) = kitchen"
    )


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("put the cup_1 next to the plant", "next_to(cup_1) = plant"),
        ("Place the pen beside the lamp, then bring the plant to the kitchen",
         "next_to(pen) = lamp, then at(plant) = kitchen"),
        ("the pen should be next to the lamp", "next_to(pen) = lamp"),
        ("put the cup next to the lamp on desk 2", "on(cup_1) = desk_2"),
    ],
)  # fmt: skip
def test_it_is_wanted_where_a_skill_brings_it_about(text: str, meant: str) -> None:
    assert relations_of_skills(BESIDE) == ("next_to",)
    assert told(read(text, ABLE)) == meant


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("put the pen next to the lamp", "'next to' names a relation that is not known; known"),
        ("put the pen under the lamp", "'under' names a relation that is not known; known are in"),
        ("bring the cup behind the sofa to the kitchen", "'behind' names a relation"),
        ("bring the pen next to the lamp to the kitchen", "it is not known that pen is next to"),
        (
            "bring the lamp next to the shelf to the study",
            "it is not known that lamp is next to shelf",
        ),
        ("bring the left cup to the kitchen", "'left'"),
        ("the pen is next to the lamp", "'next to' names a relation that is not known"),
        ("is the pen next to the lamp?", "'next to' names a relation that is not known"),
        ("go next to the sofa", "'next to' names a relation that is not known"),
        ("find the cup between the lamp", "it is not known that cup_1 or cup_2 is between lamp"),
    ],
)
def test_what_is_not_known_of_a_relation_is_said(text: str, says: str) -> None:
    with pytest.raises(NotUnderstood) as refused:
        read(text, STUDY)
    assert str(refused.value).startswith(says)


@pytest.mark.parametrize("text", ["put the lamp next to the lamp", "send hsr next to the sofa"])
def test_no_robot_and_no_thing_itself_is_beside_something(text: str) -> None:
    with pytest.raises(NotUnderstood):
        read(text, ABLE)
