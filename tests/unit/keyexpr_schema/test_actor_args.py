"""Arguments of tasks that name actors."""

from __future__ import annotations

import pytest

from keyexpr_schema.errors import InvalidId
from keyexpr_schema.ids import actor_arg, actor_in, bare_name, bound, check_id


def test_an_argument_names_an_actor_or_a_thing() -> None:
    assert actor_arg("a1") == "?a1"
    assert (actor_in("?a1"), actor_in("hsr"), actor_in(True), actor_in(None)) == (
        "a1",
        None,
        None,
        None,
    )
    assert (bare_name("?a1"), bare_name("hsr")) == ("a1", "hsr")
    with pytest.raises(InvalidId):
        check_id(actor_arg("a1"))


def test_an_actor_is_bound_to_its_robot() -> None:
    assert bound("?a1", {"a1": "hsr"}) == "hsr"
    assert bound("a1", {"a1": "hsr"}) == "a1"
    with pytest.raises(KeyError):
        bound("?a2", {"a1": "hsr"})
