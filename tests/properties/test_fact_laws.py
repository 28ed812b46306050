"""Laws of how facts are written and read: one rule, wherever a person writes one."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from keyexpr_schema.facts import FactKey, Literal, Value, parse_literal, parse_value, render_value
from tests.support.reached import Reached, reaches

NAMES = st.from_regex(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,10}", fullmatch=True)
VALUES: st.SearchStrategy[Value] = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(allow_nan=False, allow_infinity=False),
    st.text(),
    st.sampled_from(["unknown", "null", "true", "3", "1e3", '"', '"x"', " x", "007", "nan", ""]),
    st.sampled_from([2.5, -1e300, 5e-324]),
)


@reaches("quoted", "plain")
@given(VALUES)
def test_what_is_rendered_is_read_as_the_same_value(reached: Reached, value: Value) -> None:
    text = render_value(value)
    assert parse_value(text) == value
    assert type(parse_value(text)) is type(value)
    reached["quoted" if text.startswith('"') else "plain"] += 1


@reaches("str", "bool", "int", "float", "NoneType")
@given(NAMES, NAMES, VALUES)
def test_a_literal_is_read_as_it_is_written(
    reached: Reached, relation: str, subject: str, value: Value
) -> None:
    literal = Literal(FactKey(relation, subject), value)
    written = render_value(value)
    if not any(sign.isspace() for sign in written) and written:
        assert parse_literal(str(literal)) == literal
        assert parse_literal(f"{relation} {subject} {written}") == literal
        reached[type(value).__name__] += 1


@pytest.mark.parametrize(
    ("written", "value"),
    [
        ("kitchen", "kitchen"),
        ("unknown", None),
        ("null", None),
        ("true", True),
        ("True", "True"),
        ("3", 3),
        ("-3", -3),
        ("2.5", 2.5),
        ("3.0", 3.0),
        ("1e3", 1000.0),
        ("1_000", "1_000"),
        ("007", "007"),
        ("nan", "nan"),
        ("1e999", "1e999"),
        ("99999999999999999999", 99999999999999999999),
        ('"3"', "3"),
        ('"two words"', "two words"),
        ('"', '"'),
    ],
)
def test_values(written: str, value: Value) -> None:
    assert parse_value(written) == value
    assert type(parse_value(written)) is type(value)


def test_what_is_no_literal() -> None:
    for written in ("", "at cup_1", "at(cup_1)", "at(cup_1) kitchen", "at cup_1 = kitchen"):
        assert parse_literal(written) is None
