"""One rule for the names of things, on every way in: no name reads as a value."""

from __future__ import annotations

import pytest

from fleet.core.state import State
from fleet.core.table import Table
from fleet.service.catch_up import known_keys
from keyexpr_schema.errors import ForeignKey, InvalidId
from keyexpr_schema.facts import parse_value
from keyexpr_schema.ids import check_name, slug
from keyexpr_schema.keyspace import OBJECT, PLACE, ROBOT_SPEC
from keyexpr_schema.payloads.robots import RobotAddress
from keyexpr_schema.payloads.world import ObjectAddress, Place, PlaceAddress

NUMBERS = ["101", "3.5", "1e3", "0x1F", "007", "2026.1"]
VALUES = [*NUMBERS, "true", "False", "NULL", "unknown", "nothing"]


@pytest.mark.parametrize("name", VALUES)
def test_what_reads_as_a_value_names_no_place_object_or_robot(name: str) -> None:
    with pytest.raises(InvalidId, match="such as"):
        check_name(name)
    for address in (PlaceAddress, ObjectAddress, RobotAddress):
        with pytest.raises(InvalidId, match=name):
            address(name)
    for key in (PLACE, OBJECT, ROBOT_SPEC):
        with pytest.raises(ForeignKey, match="such as"):
            key.parse(key.pattern().replace("*", name))


@pytest.mark.parametrize("name", ["room_101", "r2", "2nd_floor", "cup-1", "nan", "on", "truely"])
def test_other_ids_are_names_and_read_as_themselves(name: str) -> None:
    assert check_name(name) == name == parse_value(name)


def test_a_state_of_an_earlier_version_with_such_a_name_is_caught_up_with() -> None:
    places = {name: Place(place=name, label=name) for name in ("101", "kitchen")}
    state = State(places=Table(places)).reindexed()
    assert [*known_keys(state, ())] == [(PLACE, PlaceAddress("kitchen"))]


def test_words_with_accents_keep_their_letters_in_ids() -> None:
    assert slug("Bring the café au lait to Zoë!") == "bring-the-cafe-au-lait-to-zoe"
