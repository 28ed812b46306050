"""Values that have the shape of a payload type, or nearly: what a hostile or broken client sends.

Plain data for `json.dumps`, which also writes what is no JSON (`NaN`, numbers without bounds).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from random import Random
from typing import Any

from msgspec import inspect

FLOATS = (
    0.0, -0.0, 0.5, 1.0, -1.0, 3.7, 60.0, 1e-9, 5e-324, 1e9, -1e9, 1e18, 1e308, -1e308,
    253402300800.0, -62135596801.0, float("nan"), float("inf"), float("-inf"),
)  # fmt: skip
INTEGERS = (
    0, 1, 2, 3, -1, 100, 2**31, -(2**31), 2**53, 2**53 + 1, 2**63 - 1, -(2**63), 2**63, 2**64,
    10**30, 10**400,
)  # fmt: skip
NAMES = (
    "hsr", "locobot", "cup_1", "cup_2", "kitchen", "hallway", "living_room", "kitchen_table",
    "p", "p1", "plan-1", "g", "g-1", "t1", "t2", "a1", "r1", "x", "at", "holding", "on", "in",
    "is_open", "is_on", "searched", "charge", "navigate", "pick", "place", "search", "symbolic",
    "makespan", "big-dag", "unheard_of", "cup", "floor", "planner", "sim", "disk", "person",
)  # fmt: skip
ODD_TEXTS = (
    "", " ", "?", "?a1", "?x", "nothing", "unknown", "true", "null", "101", "1e5", "0x1f", "²",
    "\u0000", "a\u0000b", "\x1b[31mred\x1b[0m", "\x9b2J", "\u202egnp", "İstanbul", "ẞ", "ﬁ", "é",
    "e\u0301", "\ud800", "🤖", "👩‍👩‍👧", "../../../etc/passwd", "/", "*", "**", "$*", "a/b", "@",
    "#", "-", ".", "a" * 63, "a" * 64, "${HOME}", "%s%n", "{0}", "\n\n", "\t",
    "'; DROP TABLE latest;--", "<script>", "[red]", "NaN", "Infinity", "\u2028", "\ufeff",
    "* * * * *", "0 8 * * 1-5", "60 24 31 2 *", "0 0 30 2 *", "Europe/Berlin", "Mars/Olympus",
    "UTC", "../UTC", "every day",
)  # fmt: skip
SENTENCES = (
    "Bring the first cup to the hallway.", "Bring cup 1 to the kitchen", "Find cup 2", "Find it",
    "Both cups are in the kitchen.", "cup 1 is in the kitchen", "cup 1 is in cup 1",
    "Whenever cup 1 is in the hallway, bring it to the kitchen",
    "If cup 1 is not in the kitchen, bring cup 2 to the hallway; otherwise find cup 2",
    "first bring cup 1 to the hallway, then to the kitchen, then to the hallway",
    "Search the kitchen every morning", "Bring 99999999999999999999 cups to the kitchen",
    "The kitchen is in the kitchen.", "Bring the kitchen to the cup", "not not not not",
    "bring " * 40, "cup 1 and " * 60 + "cup 2", "((((((((((", "” “ „",
)  # fmt: skip
CHANCE_OF_EXTREME = 0.25
WRONG: tuple[Any, ...] = (
    None, True, False, 0, -1, 1.5, "", "x", [], {}, [[]], [None], {"": None}, {"type": "no_such"},
    10**30, float("nan"), "\ud800", [[[[[[[[[[]]]]]]]]]], {"a": {"a": {"a": {"a": 1}}}},
)  # fmt: skip


@lru_cache(maxsize=256)
def type_of(kind: Any) -> inspect.Type:
    """What msgspec knows of a type."""
    return inspect.type_info(kind)


class Values:
    """Draws values of types; `names` says which ids mean something to the fleet, by field."""

    def __init__(self, rng: Random, names: Mapping[str, tuple[str, ...]]) -> None:
        self._rng, self._names = rng, names
        self._left = 0
        self._draw: dict[type[inspect.Type], Callable[[Any, str], Any]] = {
            inspect.BoolType: lambda _, __: rng.random() < 0.5,
            inspect.IntType: lambda _, __: self.integer(),
            inspect.FloatType: lambda _, __: self.number(),
            inspect.NoneType: lambda _, __: None,
            inspect.StrType: lambda kind, field: self.text(field, named=kind.pattern is not None),
            inspect.EnumType: lambda kind, _: rng.choice([one.value for one in kind.cls]),
            inspect.UnionType: lambda kind, field: self._of(rng.choice(kind.types), field),
            inspect.StructType: lambda kind, _: self._struct(kind),
            inspect.VarTupleType: lambda kind, field: self._several(kind.item_type, field),
            inspect.ListType: lambda kind, field: self._several(kind.item_type, field),
            inspect.TupleType: lambda kind, field: [self._of(k, field) for k in kind.item_types],
            inspect.DictType: self._mapping,
        }  # fmt: skip

    def of(self, kind: Any) -> Any:
        """A value of this type, with extreme fields here and there."""
        self._left = 400
        return self._of(type_of(kind), "")

    def _of(self, kind: inspect.Type, field: str) -> Any:
        self._left -= 1
        draw = self._draw.get(type(kind))
        return self.anything() if draw is None else draw(kind, field)

    def _struct(self, kind: inspect.StructType) -> dict[str, Any]:
        value: dict[str, Any] = {}
        for field in kind.fields:
            if not field.required and (self._left < 0 or self._rng.random() < 0.5):
                continue
            value[field.encode_name] = self._of(field.type, field.name)
        if isinstance(kind.tag, str | int) and kind.tag_field is not None:
            value[kind.tag_field] = kind.tag
        return value

    def _several(self, kind: inspect.Type, field: str) -> list[Any]:
        if self._left < 0:
            return []
        number = self._rng.choice((0, 1, 1, 2, 2, 3, 5))
        drawn = [self._of(kind, field) for _ in range(number)]
        if self._rng.random() < 0.01:
            drawn = drawn * self._rng.choice((50, 500))
        return drawn

    def _mapping(self, kind: inspect.DictType, field: str) -> dict[str, Any]:
        number = 0 if self._left < 0 else self._rng.choice((0, 1, 2, 3))
        keys = [self._of(kind.key_type, field) for _ in range(number)]
        return {str(key): self._of(kind.value_type, field) for key in keys}

    def integer(self) -> int:
        """A whole number, now and then an impossible one."""
        if self._rng.random() < CHANCE_OF_EXTREME:
            return self._rng.choice(INTEGERS)
        return self._rng.randint(0, 4)

    def number(self) -> float:
        """A number, now and then an impossible one."""
        if self._rng.random() < CHANCE_OF_EXTREME:
            return self._rng.choice(FLOATS)
        return round(self._rng.uniform(-5.0, 200.0), 2)

    def text(self, field: str, *, named: bool = False) -> str:
        """A text, or a name as `field` has them."""
        known = self._names.get(field) or self._names.get(field.removesuffix("s"))
        drawn = self._rng.random()
        if known and drawn < 0.75:
            return self._rng.choice(known)
        if named and drawn < 0.97:
            return self._rng.choice(NAMES)
        if drawn < 0.3:
            return self._rng.choice(NAMES)
        if drawn < 0.6:
            return self._rng.choice(SENTENCES)
        if drawn < 0.985:
            return self._rng.choice(ODD_TEXTS)
        return self._rng.choice(ODD_TEXTS[20:]) * self._rng.choice((300, 5_000))

    def anything(self) -> Any:
        """What no field wants."""
        return self._rng.choice(WRONG)

    def spoiled(self, value: Any) -> Any:
        """The value with one thing wrong somewhere: another type, a field more or less, a tag."""
        rng = self._rng
        if isinstance(value, dict) and value and rng.random() < 0.85:
            name = rng.choice(list(value))
            how = rng.random()
            if how < 0.15:
                return {key: each for key, each in value.items() if key != name}
            if how < 0.3:
                return {
                    **value,
                    rng.choice(("type", "x", "", "time_s", "by", name)): self.anything(),
                }
            return {**value, name: self.spoiled(value[name])}
        if isinstance(value, list) and value and rng.random() < 0.7:
            at = rng.randrange(len(value))
            return [*value[:at], self.spoiled(value[at]), *value[at + 1 :]]
        return self.anything()
