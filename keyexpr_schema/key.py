"""`Key`: one type that builds, parses, encodes and decodes one family of key expressions."""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import Enum, Flag, auto
from functools import cached_property
from typing import Any, Generic, TypeVar

import msgspec

from keyexpr_schema.decoding import decode, too_large
from keyexpr_schema.errors import ForeignKey, InvalidId, UndecodablePayload
from keyexpr_schema.ids import ID_PATTERN, ID_RULE, check_id, check_name

SCHEMA_PREFIX = "robotfleet"


class Payload(msgspec.Struct, frozen=True, kw_only=True):
    """Base of every payload. JSON; a field added later has a default, so old bytes decode."""


class Address(msgspec.Struct, frozen=True, order=True):
    """Base of every address: the variable chunks of a key, in order.

    Fields are `str` (an id) or `int` (a positive count). An invalid address cannot be made.

    Raises:
        InvalidId: on construction, if a field cannot be a chunk.
    """

    def __post_init__(self) -> None:
        for name in self.__struct_fields__:
            value = getattr(self, name)
            if isinstance(value, str):
                check_id(value, name)
            elif not isinstance(value, int) or isinstance(value, bool) or value < 1:
                raise InvalidId(f"{name} {value!r} is not valid: use a whole number from 1 up")


class NamedAddress(Address, frozen=True):
    """Base of the address of what values name: a place, an object, a robot (see `check_name`)."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in self.__struct_fields__:
            check_name(getattr(self, name), name)


A = TypeVar("A", bound=Address)
P = TypeVar("P", bound=Payload)


class Component(Flag):
    """Who writes and reads keys; flags, so that `PLANNER | PERSON` is both."""

    PERSON = auto()
    """Whoever uses the fleet: by robotctl, or by a program of one's own."""
    PLANNER = auto()
    WORKER = auto()
    """The worker of any robot."""
    OWN_WORKER = auto()
    """The worker of the robot that the key names, and no other."""
    SIMULATION = auto()
    RECORDER = auto()
    STORE = auto()
    ANYONE = PERSON | PLANNER | WORKER | SIMULATION | RECORDER


class Delivery(Enum):
    """What becomes of a value after it is put."""

    STORED = "stored"
    LATEST = "stored, latest matters"
    STREAM = "not stored"
    SEQUENCE = "not stored, every one counts"
    TOKEN = "liveliness token"
    QUERY = "query and reply"


@dataclass(frozen=True)
class Key(Generic[A, P]):
    """One row of the key-space.

    `template` is a key expression whose `{field}` chunks are the fields of `address`.
    `writers` put or delete values of type `payload`, or hold the token; `readers` get or watch
    them. Where `delivery` is `QUERY`, writers send `payload` as a query and readers serve it, with
    a reply of type `reply`. `by_receipt`: of what different writers put, that holds which the store
    received last, whatever their clocks say; of all other keys what has the latest stamp.
    `put_back`: what a store has lost of them the planner, which reads them, puts again.
    """

    name: str
    template: str
    address: type[A]
    payload: type[P]
    writers: Component
    readers: Component
    delivery: Delivery
    about: str
    version: int = 1
    reply: type[Payload] | None = None
    by_receipt: bool = False
    put_back: bool = False

    def __post_init__(self) -> None:
        fields = re.findall(r"\{(\w+)\}", self.template)
        if tuple(fields) != self.address.__struct_fields__:
            raise TypeError(
                f"{self.name}: the template has {fields}, {self.address.__name__} has other fields"
            )

    @cached_property
    def schema(self) -> str:
        """The schema suffix of the Zenoh encoding, e.g. `robotfleet/goal_spec/1`."""
        return f"{SCHEMA_PREFIX}/{self.name}/{self.version}"

    @cached_property
    def stored(self) -> bool:
        """Whether the store keeps the value."""
        return self.delivery in (Delivery.STORED, Delivery.LATEST)

    @cached_property
    def of_processes(self) -> bool:
        """Whether values are written by processes of the fleet alone, not by robots or people."""
        return not self.writers & ~(Component.PLANNER | Component.SIMULATION | Component.STORE)

    def build(self, address: A) -> str:
        """The key expression of `address`, canonical and without wildcards."""
        return self.template.format(**msgspec.structs.asdict(address))

    def pattern(self, **fixed: str | int) -> str:
        """The key expression that matches every address whose named fields have these values.

        Raises:
            InvalidId: a value cannot be a chunk.
            TypeError: a name is not a field of the address.
        """
        unknown = set(fixed) - set(self.address.__struct_fields__)
        if unknown:
            raise TypeError(f"{self.name} has no field {', '.join(sorted(unknown))}")
        chunks = dict.fromkeys(self.address.__struct_fields__, "*")
        for name, value in fixed.items():
            chunks[name] = check_id(str(value), name)
        return self.template.format(**chunks)

    def parse(self, keyexpr: str) -> A:
        """The address a key expression was built from.

        Raises:
            ForeignKey: the key expression is not one of this key.
        """
        match = self._parser.fullmatch(keyexpr)
        why = f"those look like {self.template!r}"
        if match is not None:
            try:
                chunks = zip(match.groups(), self._numbers, strict=True)
                return self.address(*(int(text) if number else text for text, number in chunks))
            except InvalidId as error:
                why = str(error)
        raise ForeignKey(f"{keyexpr!r} is not a {self.name} key: {why}")

    @cached_property
    def _numbers(self) -> list[bool]:
        """Of each field of the address, whether it is a count."""
        return [kind in (int, "int") for kind in self.address.__annotations__.values()]

    @cached_property
    def _parser(self) -> re.Pattern[str]:
        chunks = iter(self._numbers)
        return re.compile(
            re.sub(
                r"\{\w+\}",
                lambda _: "([1-9][0-9]{0,17})" if next(chunks) else "([^/]+)",
                self.template,
            )
        )

    def encode(self, payload: P) -> bytes:
        """JSON bytes of `payload`; that they decode is for the caller to see to, or `check`."""
        return msgspec.json.encode(payload)

    def check(self, payload: P, address: A) -> bytes:
        """JSON bytes of `payload` that every reader can decode.

        A struct takes any value when it is made: without this a wrong one would be found out only
        by its readers, and whoever waits for them would wait in vain.

        Raises:
            UndecodablePayload: a field has a value that its type does not allow.
        """
        data = self.encode(payload)
        self.decode(data, self.build(address))
        return data

    def decode(self, data: bytes, keyexpr: str | None = None) -> P:
        """The payload in `data`.

        Raises:
            UndecodablePayload: it is not one; the message names the field and what it should be.
        """
        return decode_payload(self.payload, data, keyexpr or self.template)


@dataclass(frozen=True)
class KeyTree:
    """Keys that are deleted together, by one message with a wildcard."""

    template: str
    keys: tuple[Key[Any, Any], ...]

    def build(self, name: str) -> str:
        """The key expression of all keys about `name`.

        Raises:
            InvalidId: the name cannot be a chunk.
        """
        return re.sub(r"\{(\w+)\}", lambda field: check_id(name, field[1]), self.template)

    def of(self, address: Address) -> str:
        """The key expression of the tree that the key with this address is in."""
        return re.sub(r"\{(\w+)\}", lambda field: getattr(address, field[1]), self.template)

    def pattern(self) -> str:
        """The key expression of all such keys, whatever they are about."""
        return re.sub(r"\{\w+\}", "*", self.template)

    def is_of_one(self, keyexpr: str) -> bool:
        """Whether a key expression is one that `build` makes."""
        return self._parser.fullmatch(keyexpr) is not None

    @cached_property
    def _parser(self) -> re.Pattern[str]:
        chunks = re.split(r"\{\w+\}", self.template)
        return re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,62}".join(map(re.escape, chunks)))


def decode_payload(kind: type[P], data: bytes, where: str) -> P:
    """Decode JSON `data` found at `where` as `kind`.

    Raises:
        UndecodablePayload: it is not one; the message names the field and what it should be.
    """
    try:
        found = decode(data, kind)
        if _LARGE.search(data) and (number := too_large(found)) is not None:
            said = number if abs(number) < 10**30 else "a number of more than 30 digits"
            raise msgspec.DecodeError(f"{said} is larger than any number that can be meant")
        return found
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise UndecodablePayload(
            f"the value at {where} is not a {kind.__name__}: {plainly(error)}"
        ) from None


_LARGE = re.compile(rb"(?<![0-9.])[0-9]{12}|[0-9][eE]\+?[0-9]")
"""What has neither a long row of digits nor an exponent has no number that is too large."""


def plainly(error: Exception) -> str:
    """The text of a decoding error, with the rule for names in words and not as a pattern."""
    return str(error).replace(f"`str` matching regex {ID_PATTERN!r}", f"a name ({ID_RULE})")
