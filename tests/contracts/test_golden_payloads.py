"""Bytes of every payload as they were once written still decode, and nothing in them is lost.

For a new payload type or a new field run `python -m tests.contracts.test_golden_payloads` and
commit what it adds under golden/ (`full-2` beside `full` for a field more). Bytes that are there
are never rewritten.
"""

from __future__ import annotations

import enum
import types
import typing
from pathlib import Path
from typing import Any

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from keyexpr_schema.decoding import LARGEST_FRACTION
from keyexpr_schema.errors import UndecodablePayload
from keyexpr_schema.key import Key, Payload, decode_payload
from keyexpr_schema.keyspace import KEYSPACE
from tests.support.reached import reaches

GOLDEN = Path(__file__).parent / "golden"


def top_level() -> dict[str, type[Payload]]:
    """Every payload that travels by itself, by file name."""
    kinds: dict[str, type[Payload]] = {}
    for key in KEYSPACE:
        kinds[f"{key.name}.{key.version}"] = key.payload
        if key.reply is not None:
            kinds[f"{key.name}_reply.1"] = key.reply
    return kinds


def sample(kind: Any, name: str = "x") -> Any:
    """A value of `kind` in which every field is set, the same one every time."""
    origin, args = typing.get_origin(kind), typing.get_args(kind)
    if origin is typing.Annotated:
        is_id = args[0] is str and kind.__metadata__[0].pattern is not None
        return name.replace("_", "-") if is_id else sample(args[0], name)
    if origin in (typing.Union, types.UnionType):
        return sample(args[0], name)
    if origin is tuple:
        inner = args[:1] if args[-1] is Ellipsis else args
        return tuple(sample(one, name) for one in inner)
    if origin is dict:
        return {sample(args[0], name): sample(args[1], name)}
    if isinstance(kind, type) and issubclass(kind, enum.Enum):
        return list(kind)[-1]
    if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
        fields = msgspec.structs.fields(kind)
        return kind(**{field.name: sample(field.type, field.name) for field in fields})
    return {str: name, int: 3, float: 1.5, bool: True}[kind]


def required_only(kind: Any) -> Any:
    """A value of `kind` with nothing set that need not be."""
    fields = [field for field in msgspec.structs.fields(kind) if field.required]
    return kind(**{field.name: sample(field.type, field.name) for field in fields})


def variants(kind: type[Payload]) -> dict[str, Payload]:
    return {"full": sample(kind), "least": required_only(kind)}


def variants_of(name: str) -> list[str]:
    """The variants that must be there, and those that earlier fields left."""
    later = sorted(path.name.split(".")[-2] for path in GOLDEN.glob(f"{name}.full-*.json"))
    return ["full", "least", *later]


CASES = [(name, kind, v) for name, kind in top_level().items() for v in variants_of(name)]


@pytest.mark.parametrize(("name", "kind", "variant"), CASES)
def test_golden_bytes_decode_and_nothing_in_them_is_lost(name, kind, variant):
    path = GOLDEN / f"{name}.{variant}.json"
    assert path.exists(), (
        f"run python -m tests.contracts.test_golden_payloads and commit {path.name}"
    )
    data = path.read_bytes()
    decoded = decode_payload(kind, data, path.name)
    written = msgspec.json.decode(msgspec.json.encode(decoded))
    assert covers(written, msgspec.json.decode(data))


def covers(new: Any, old: Any) -> bool:
    """Whether `new` says all that `old` says; it may have fields that `old` lacks."""
    if isinstance(old, dict):
        return isinstance(new, dict) and all(k in new and covers(new[k], v) for k, v in old.items())
    if isinstance(old, list):
        return len(new) == len(old) and all(map(covers, new, old))
    return new == old


def test_no_golden_bytes_without_a_payload():
    """A version that is gone from the table would leave bytes that nobody can read any more."""
    names = {f"{name}.{variant}.json" for name, _, variant in CASES}
    assert {path.name for path in GOLDEN.glob("*.json")} == names


@pytest.mark.parametrize(("name", "kind"), top_level().items())
def test_every_field_stands_in_golden_bytes(name, kind):
    fresh = msgspec.json.decode(msgspec.json.encode(sample(kind)))
    assert any(
        covers(msgspec.json.decode(path.read_bytes()), fresh)
        for path in GOLDEN.glob(f"{name}.full*.json")
    ), "run python -m tests.contracts.test_golden_payloads and commit what it adds"


@pytest.mark.parametrize("kind", top_level().values(), ids=top_level().keys())
def test_a_field_from_the_future_is_passed_over(kind):
    fields = msgspec.to_builtins(sample(kind))
    data = msgspec.json.encode({**fields, "field_of_a_later_version": [1, {"a": None}]})
    assert decode_payload(kind, data, "here") == sample(kind)


def strategy(kind: Any) -> st.SearchStrategy[Any]:
    origin, args = typing.get_origin(kind), typing.get_args(kind)
    if origin is typing.Annotated and args[0] is float:
        return st.floats(0.5, 90.0)
    if origin is typing.Annotated:
        return st.from_regex(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,8}", fullmatch=True)
    if origin in (typing.Union, types.UnionType):
        return st.one_of([strategy(one) for one in args])
    if origin is tuple and args[-1] is Ellipsis:
        return st.lists(strategy(args[0]), max_size=2).map(tuple)
    if origin is tuple:
        return st.tuples(*(strategy(one) for one in args))
    if origin is dict:
        return st.dictionaries(strategy(args[0]), strategy(args[1]), max_size=2)
    if kind is type(None):
        return st.none()
    if isinstance(kind, type) and issubclass(kind, enum.Enum):
        return st.sampled_from(kind)
    if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
        fields = msgspec.structs.fields(kind)
        return st.builds(kind, **{field.name: strategy(field.type) for field in fields})
    plain: dict[Any, st.SearchStrategy[Any]] = {
        str: st.text(max_size=8),
        int: st.integers(-(2**53), 2**53),
        float: st.floats(-LARGEST_FRACTION, LARGEST_FRACTION),
        bool: st.booleans(),
    }
    return plain[kind]


STRATEGIES = {key.name: strategy(key.payload) for key in KEYSPACE}


@given(st.data())
@settings(max_examples=200, deadline=None)
def test_every_payload_survives_the_journey(data):
    key: Key[Any, Any] = data.draw(st.sampled_from(KEYSPACE))
    value = data.draw(STRATEGIES[key.name])
    decoded = key.decode(key.encode(value))
    assert key.encode(decoded) == key.encode(value)


@reaches("undecodable")
@given(st.sampled_from(KEYSPACE), st.binary(max_size=60))
def test_any_bytes_decode_or_are_undecodable_and_nothing_else(reached, key, data):
    try:
        key.decode(data)
    except UndecodablePayload as error:
        reached["undecodable"] += 1
        assert "\n" not in str(error)


def main() -> None:
    GOLDEN.mkdir(exist_ok=True)
    for name, kind in top_level().items():
        for variant, value in variants(kind).items():
            path = GOLDEN / f"{name}.{variant}.json"
            if not path.exists():
                path.write_bytes(msgspec.json.encode(value))
        full = sorted(GOLDEN.glob(f"{name}.full*.json"))
        fresh = msgspec.json.encode(sample(kind))
        wanted = msgspec.json.decode(fresh)
        if not any(covers(msgspec.json.decode(path.read_bytes()), wanted) for path in full):
            (GOLDEN / f"{name}.full-{len(full) + 1}.json").write_bytes(fresh)


if __name__ == "__main__":
    main()
