"""Laws of the key-space, with Zenoh itself as the oracle for key expressions."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import pytest
import zenoh
from hypothesis import given, settings
from hypothesis import strategies as st

from keyexpr_schema.errors import ForeignKey, InvalidId
from keyexpr_schema.ids import ID_PATTERN, check_id, slug
from keyexpr_schema.key import Key, NamedAddress
from keyexpr_schema.key_lookup import key_of
from keyexpr_schema.keyspace import KEYSPACE
from keyexpr_schema.transport.store.storage import is_stored
from tests.support.reached import reaches

IDS = st.from_regex(ID_PATTERN.rstrip("$") + r"\Z")
NAMES = IDS.map(lambda text: f"z{text}"[:63])
"""Ids that are no values: of places, objects and robots."""
HOSTILE = st.one_of(
    st.sampled_from(["", "/", "*", "**", "$*", "#", "?", "@", "a/b", "a*", "a$*", "@a", "a?x=1"]),
    st.sampled_from(["a#", "-a", ".a", "_a", "a b", "a\n", "a\0"]),
    st.sampled_from(["k\u00fcche", "cafe\u0301", "\u0661"]),
    st.integers(64, 300).map(lambda n: "a" * n),
    st.tuples(IDS, st.sampled_from("/*$#?@\u00e9\n \0"), IDS).map("".join),
)


COUNTED = tuple(key for key in KEYSPACE if {int, "int"} & {*key.address.__annotations__.values()})


@st.composite
def keys_and_addresses(
    draw: st.DrawFn, keys: Sequence[Key[Any, Any]] = KEYSPACE
) -> tuple[Key[Any, Any], Any]:
    key = draw(st.sampled_from(keys))
    types = key.address.__annotations__
    ids = NAMES if issubclass(key.address, NamedAddress) else IDS
    fields = [
        draw(st.integers(1, 10**17) if types[name] in (int, "int") else ids)
        for name in key.address.__struct_fields__
    ]
    return key, key.address(*fields)


@given(keys_and_addresses())
def test_what_is_built_is_canonical_and_parses_back(case):
    key, address = case
    keyexpr = key.build(address)
    assert str(zenoh.KeyExpr.autocanonize(keyexpr)) == keyexpr
    assert key.parse(keyexpr) == address
    assert key_of(keyexpr) is key
    assert is_stored("robotfleet/" + keyexpr) == key.stored
    pattern = zenoh.KeyExpr(key.pattern())
    assert str(zenoh.KeyExpr.autocanonize(key.pattern())) == key.pattern()
    assert pattern.includes(keyexpr)
    for name in key.address.__struct_fields__:
        assert zenoh.KeyExpr(key.pattern(**{name: getattr(address, name)})).includes(keyexpr)


@given(keys_and_addresses(), keys_and_addresses())
def test_two_addresses_have_two_keys(one, other):
    same = one[0] is other[0] and one[1] == other[1]
    assert (one[0].build(one[1]) == other[0].build(other[1])) == same


def test_patterns_are_pairwise_disjoint():
    for one, other in itertools.combinations(KEYSPACE, 2):
        assert not zenoh.KeyExpr(one.pattern()).intersects(other.pattern()), (one.name, other.name)


def test_names_are_unique():
    assert len({key.name for key in KEYSPACE}) == len(KEYSPACE)


@given(HOSTILE)
def test_a_hostile_id_makes_no_address_pattern_or_payload(text):
    with pytest.raises(InvalidId, match="use 1 to 63 ASCII letters"):
        check_id(text)
    for key in KEYSPACE:
        types = key.address.__annotations__
        for name in key.address.__struct_fields__:
            fields = {
                other: 1 if types[other] in (int, "int") else "a"
                for other in key.address.__struct_fields__
            }
            with pytest.raises(InvalidId):
                key.address(**{**fields, name: text})
            with pytest.raises(InvalidId):
                key.pattern(**{name: text})


@reaches("refused")
@given(st.sampled_from(KEYSPACE), st.text(max_size=80))
def test_a_foreign_key_expression_is_refused_and_nothing_else_is_raised(reached, key, text):
    for candidate in (text, key.template, key.pattern()):
        try:
            address = key.parse(candidate)
        except ForeignKey:
            reached["refused"] += 1
            continue
        assert key.build(address) == candidate


@reaches("a count")
@given(
    keys_and_addresses(COUNTED), st.sampled_from(["01", "0", "-1", "1.0", "+1", "\u0661", "9" * 19])
)
def test_a_count_has_one_spelling(reached, case, text):
    key, address = case
    types = key.address.__annotations__
    for number, name in enumerate(key.template.split("/")):
        if name.startswith("{") and types[name[1:-1]] in (int, "int"):
            chunks = key.build(address).split("/")
            chunks[number] = text
            reached["a count"] += 1
            with pytest.raises(ForeignKey):
                key.parse("/".join(chunks))


@reaches("an id", "none")
@given(st.text(max_size=100))
@settings(max_examples=200)
def test_a_slug_is_an_id(reached, text):
    try:
        assert check_id(slug(text))
        reached["an id"] += 1
    except InvalidId:
        reached["none"] += 1
        assert not any(c.isascii() and c.isalnum() for c in text.lower())
