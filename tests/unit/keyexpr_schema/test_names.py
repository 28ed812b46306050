"""One rule for the names of things, on every way in: no name reads as a value."""

from __future__ import annotations

import pytest

from keyexpr_schema.errors import ForeignKey, InvalidId
from keyexpr_schema.facts import parse_value
from keyexpr_schema.ids import check_name, slug
from keyexpr_schema.keyspace import OBJECT, PLACE, ROBOT_SPEC
from keyexpr_schema.payloads.robots import RobotAddress
from keyexpr_schema.payloads.world import ObjectAddress, PlaceAddress

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


def test_words_with_accents_keep_their_letters_in_ids() -> None:
    assert slug("Bring the café au lait to Zoë!") == "bring-the-cafe-au-lait-to-zoe"
