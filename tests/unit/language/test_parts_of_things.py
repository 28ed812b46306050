"""A thing of which the parts open is opened, closed and asked about by its own name."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fleet.errors import NotUnderstood
from fleet.language import Reading, read
from keyexpr_schema.payloads.goals import Condition
from tests.support.language_flat import FURNISHED, thing
from tests.support.language_flat_said import told

PARTS = (
    thing("cabinet", movable=False),
    thing("drawer_1", "contains", "openable", label="upper drawer", part_of="cabinet"),
    thing("drawer_2", "contains", "openable", label="lower drawer", part_of="cabinet"),
    thing("locker", movable=False),
    thing("hatch", "contains", "openable", part_of="locker"),
)
WITH_PARTS = replace(
    FURNISHED,
    objects={**FURNISHED.objects, **{each.object: each for each in PARTS}},
    carriers={
        **FURNISHED.carriers,
        "cabinet": ("living_room",),
        "drawer_1": ("cabinet", "living_room"),
        "drawer_2": ("cabinet", "living_room"),
        "locker": ("hallway",),
        "hatch": ("locker", "hallway"),
    },
)
BOTH = ("is_open(drawer_1) = false", "is_open(drawer_2) = false")


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("Close the cabinet", " and ".join(BOTH)),
        ("The cabinet should be closed", " and ".join(BOTH)),
        ("Close the cabinet and the locker", " and ".join((*BOTH, "is_open(hatch) = false"))),
        ("Open the locker", "is_open(hatch) = true"),
        ("Open the locker, put the fork in it and close it",
         "is_open(hatch) = true and in(fork) = hatch, then is_open(hatch) = false"),
        ("Keep the cabinet closed", ", ".join(f"always {each}" for each in BOTH)),
        ("Never open the cabinet",
         "never is_open(drawer_1) = true, never is_open(drawer_2) = true"),
        ("The cabinet should never be open",
         "never is_open(drawer_1) = true, never is_open(drawer_2) = true"),
        ("The locker is open", "is_open(hatch) = true is so"),
        ("The cabinet is closed", f"{'; '.join(BOTH)} is so"),
        ("If the locker is open, close it", "is_open(hatch) = false, if is_open(hatch) = true"),
        ("Open the cabinet's upper drawer", "is_open(drawer_1) = true"),
        ("Put the fork in the locker's hatch", "in(fork) = hatch"),
        ("Open the hatch of the locker", "is_open(hatch) = true"),
        ("Open the upper drawer in the cabinet", "is_open(drawer_1) = true"),
        ("Open the kitchen's fridge", "is_open(fridge) = true"),
    ],
)  # fmt: skip
def test_its_parts_are_meant(text: str, meant: str) -> None:
    assert told(read(text, WITH_PARTS)) == meant


@pytest.mark.parametrize("text", ["Open the cabinet", "The cabinet is open"])
def test_of_several_that_may_be_open_it_is_asked_which(text: str) -> None:
    asked = told(read(text, WITH_PARTS))
    assert asked.startswith("asks is_open(drawer_1) = true")
    assert asked.count(" | ") == 2  # the upper one, the lower one, both


def test_it_is_open_if_any_part_is_and_closed_if_all_are() -> None:
    def holds(text: str) -> tuple[Condition, ...]:
        reading = read(text, WITH_PARTS)
        assert isinstance(reading, Reading)
        assert reading.question is not None
        return reading.question.holds

    (any_open,) = holds("Is the cabinet open?")
    assert any_open.any_of == ("drawer_1", "drawer_2")
    assert [(c.subject, c.value) for c in holds("Is the cabinet closed?")] == [
        ("drawer_1", False), ("drawer_2", False),
    ]  # fmt: skip


def test_what_belongs_to_nothing_of_that_name_is_refused_by_name() -> None:
    with pytest.raises(NotUnderstood, match=r"nothing of that kind is known to be locker's"):
        read("Open the locker's drawer", WITH_PARTS)
    with pytest.raises(NotUnderstood, match=r"'the shelf': shelf cannot be opened"):
        read("Open the shelf", WITH_PARTS)
