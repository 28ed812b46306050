"""What a hostile or broken client does to a fleet's keys, one message after the other.

Message number N of a seed is always the same. What by the protocol is *obeyed* is not sent, since
nothing would be learned from it: a status that says that another planner is in charge, orders of
an epoch that no planner takes one above, tokens of a
second run of what there is one of, calls that take the place of a robot's worker at its driver, and
that a robot is registered no more.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from random import Random
from typing import Any

import msgspec

from keyexpr_schema.key import Delivery, Key
from keyexpr_schema.keyspace import (
    KEYSPACE,
    ORDER,
    PLANNER_STATUS,
    ROBOT_SPEC,
    SIM_ALIVE,
    SIM_MOTION,
    STORE_ALIVE,
)
from keyexpr_schema.payloads.system import LARGEST_EPOCH
from tests.fuzz.values import NAMES, ODD_TEXTS, Values

ROBOTS = ("hsr", "locobot")
FIELDS: dict[str, tuple[str, ...]] = {
    "robot": (*ROBOTS, *ROBOTS, "r9", "cart"),
    "plan": ("p1", "plan-1", "p2"),
    "task": ("t1", "t2", "t3"),
    "goal": ("g1", "g2", "bring-cup"),
    "object": ("cup_1", "cup_2", "thing_9"),
    "place": ("kitchen", "hallway", "living_room", "attic"),
    "region": ("kitchen_door", "zone_1"),
    "subject": ("cup_1", "cup_2", "hsr", "locobot", "kitchen"),
    "relation": ("at", "holding", "on", "in", "is_open", "searched", "charge"),
    "actor": ("a1", "a2"),
    "skill": ("navigate", "pick", "place", "search", "hand_over", "do"),
    "request": ("r1", "r2", "r3"),
    "statement": ("s1", "s2"),
    "schedule": ("every-day", "w1"),
    "stop": ("stop-1", "stop-2"),
    "hold": ("hold-1", "hold-2"),
    "closure": ("closure-1",),
    "component": ("planner", "recorder", "robotctl"),
    "check": ("store", "disk"),
    "model": ("hsr", "locobot"),
    "kind": ("cup", "room"),
    "planner": ("symbolic",),
    "strategy": ("big-dag",),
    "allocator": ("makespan",),
    "incarnation": ("i1", "i2"),
}
"""Names that mean something to a fleet with the two-cups mission, by field."""
SELECTORS = ("", "?", "?_time=[now(-1h)..]", "?a;b=c", "?" + "x" * 2000, "?%00", "?\u202e")


@dataclass(frozen=True)
class Message:
    """One thing that is done: `put`, `delete`, `query` or `token`.

    `ahead_s`: its time stamp is that much ahead of the clock, behind where negative; None: ours.
    """

    operation: str
    keyexpr: str
    data: bytes = b""
    encoding: str = ""
    ahead_s: float | None = None


def message(seed: int, number: int) -> Message:
    """Message `number` of a run."""
    rng = Random(f"{seed}/{number}")
    return _message(rng, rng.choice(KEYSPACE))


def _message(rng: Random, key: Key[Any, Any]) -> Message:
    values = Values(rng, FIELDS)
    keyexpr, address = _place(rng, values, key)
    drawn = rng.random()
    if key.delivery is Delivery.TOKEN:
        named = keyexpr
        if key in (SIM_ALIVE, STORE_ALIVE) or any(robot in keyexpr for robot in ROBOTS):
            named = f"{rng.choice(('odd', 'robots/r9', 'planner'))}/alive/{rng.choice(NAMES)}"
        return Message("token", named)
    if key is ROBOT_SPEC and any(robot in keyexpr for robot in ROBOTS):
        drawn = max(drawn, 0.075)
    if drawn < 0.07:
        return Message("delete", keyexpr, ahead_s=_ahead_s(rng))
    if drawn < 0.075 and key is not ROBOT_SPEC:
        return Message("delete", key.pattern())
    query = key.delivery is Delivery.QUERY
    if query or drawn < 0.12:
        selected = keyexpr if query and drawn < 0.95 else rng.choice((key.pattern(), "**", keyexpr))
        selected += rng.choice(SELECTORS) if rng.random() < 0.1 else ""
        data = _bytes(rng, values, key, address) if query or rng.random() < 0.3 else b""
        return Message("query", selected, data, _encoding(rng, key))
    data = _bytes(rng, values, key, address)
    return Message("put", keyexpr, data, _encoding(rng, key), _ahead_s(rng))


def _place(rng: Random, values: Values, key: Key[Any, Any]) -> tuple[str, dict[str, Any]]:
    """A key expression of `key`, or nearly, and the fields of the address there."""
    address: dict[str, Any] = {}
    kinds = key.address.__annotations__
    for field in key.address.__struct_fields__:
        if kinds[field] in (int, "int"):
            address[field] = rng.choice((1, 1, 2, 3, 10**17, 10**18, 0))
        elif rng.random() < 0.05:
            address[field] = rng.choice(ODD_TEXTS)
        else:
            address[field] = rng.choice(FIELDS.get(field, NAMES))
    keyexpr = key.template.format(**address)
    if rng.random() < 0.02:
        keyexpr += rng.choice(("/x", "/x/y/z", "/@x", "x"))
    return keyexpr, address


def _bytes(rng: Random, values: Values, key: Key[Any, Any], address: dict[str, Any]) -> bytes:
    value = values.of(key.payload)
    if rng.random() < 0.85:
        value.update({name: each for name, each in address.items() if name in value})
    if rng.random() < 0.4:
        value = values.spoiled(value)
    if isinstance(value, dict):
        _not_to_be_obeyed(rng, key, value)
    text = json.dumps(value, ensure_ascii=rng.random() < 0.5)
    data = text.encode(errors="surrogatepass")
    return rng.choice(BROKEN)(rng, data, value) if rng.random() < 0.12 else data


def _not_to_be_obeyed(rng: Random, key: Key[Any, Any], value: dict[str, Any]) -> None:
    if key is PLANNER_STATUS and isinstance(value.get("epoch"), int):
        value["epoch"] = rng.choice((0, -1, LARGEST_EPOCH + 1, 2**62, 2**64))
    if key is ORDER and value.get("epoch") == LARGEST_EPOCH:
        value["epoch"] += 1
    if key is SIM_MOTION:
        value["incarnation"] = rng.choice(("", "**", None, "\ud800"))


def _truncated(rng: Random, data: bytes, _: Any) -> bytes:
    return data[: rng.randrange(len(data) + 1)]


def _flipped(rng: Random, data: bytes, _: Any) -> bytes:
    at = rng.randrange(len(data)) if data else 0
    return data[:at] + bytes([rng.randrange(256)]) + data[at + 1 :]


def _packed(rng: Random, data: bytes, value: Any) -> bytes:
    try:
        packed = msgspec.msgpack.encode(value)
    except (OverflowError, UnicodeEncodeError):
        packed = b"\xdf\xff\xff\xff\xff"
    return packed[: rng.randrange(len(packed) + 1)] if rng.random() < 0.5 else packed


def _nested(rng: Random, data: bytes, _: Any) -> bytes:
    depth = rng.choice((50, 500, 5_000, 100_000))
    opened, closed = rng.choice(((b"[", b"]"), (b'{"a":', b"}")))
    return opened * depth + rng.choice((b"", b"1" + closed * depth))


def _nested_in(rng: Random, data: bytes, value: Any) -> bytes:
    """A field of the value holds something that is nested without end."""
    if not isinstance(value, dict) or not value:
        return _nested(rng, data, value)
    depth = rng.choice((50, 900, 20_000))
    text = json.dumps({**value, rng.choice((*value, "x")): "@@"}, ensure_ascii=True)
    return text.encode().replace(b'"@@"', b"[" * depth + b"]" * depth)


def _doubled(rng: Random, data: bytes, _: Any) -> bytes:
    return data + rng.choice((data, b" ", b"\0", b"\n{}", b","))


BROKEN: tuple[Callable[[Random, bytes, Any], bytes], ...] = (
    _truncated,
    _flipped,
    _packed,
    _nested,
    _nested_in,
    _doubled,
    lambda *_: b"",
    lambda *_: b"\xff\xfe",
    lambda *_: b"null",
    lambda rng, *_: rng.randbytes(rng.choice((1, 20, 3000))),
    lambda _, data, __: b"\xef\xbb\xbf" + data,
)


def _encoding(rng: Random, key: Key[Any, Any]) -> str:
    drawn = rng.random()
    if drawn < 0.7:
        return f"application/json;{key.schema}"
    if drawn < 0.9:
        return ""
    return rng.choice(
        (
            "text/plain",
            "application/json;robotfleet/fact/1",
            f"application/json;robotfleet/{key.name}/99",
            f"application/json;robotfleet/{key.name}/{'9' * 200}",
            f"application/json;robotfleet/{key.name}/²",
            "application/json;\u0000",
            "zenoh/bytes;" + "x" * 200,
        )
    )


def _ahead_s(rng: Random) -> float | None:
    drawn = rng.random()
    if drawn < 0.9:
        return None
    return rng.choice((-1e9, -86400.0, -5.0, 0.2, 5.0, 86400.0, 1e9))
