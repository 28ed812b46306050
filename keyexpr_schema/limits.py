"""How much a fleet takes in: sizes, counts, and how far ahead a clock may be.

Every limit is one field of `Limits`; `robotctl.yaml` may say others in its section `limits`, the
same for all processes of a fleet. What is beyond one is not kept by the store, which says so to
whoever waits for the confirmation, and is not taken in by those who hear of it on the way.

How deep a value may be nested is no limit of its own: no payload type holds itself, and what a type
does not name is skipped. Numbers are limited where values are decoded (`decoding`).
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

from keyexpr_schema.key import Key


@dataclass(frozen=True)
class Limits:
    """What a fleet takes in at most."""

    value_kb: int = 256
    """The size of a value that people and robots write [KiB]."""
    document_mb: int = 32
    """The size of what is large by nature [MiB]: plans, reports, and what planner and simulation
    write."""
    goals: int = 20_000
    """Goals that have keys, those that have ended included."""
    open_goals: int = 1_000
    """Goals that the planner looks at at a time; others wait until some have ended."""
    facts: int = 20_000
    """Facts, each about one thing."""
    keys: int = 50_000
    """Keys of any other kind that people and robots write (statements, objects, requests, …)."""
    documents: int = 1_000_000
    """Keys of any kind that planner and simulation write (task records, orders, …), and reports."""
    ahead_s: float = 5.0
    """How far a time stamp may be ahead of the clock of who judges it [s]; a fleet's clocks differ
    by less (`transport.clock_skew`)."""
    rejects: int = 200
    """Keys with a bad value of which one component tells by name; all others are counted."""
    unconfirmed: int = 1_000
    """Writes that nobody waits for, at once, of all writers together who have used up what each has
    for himself (`transport.store.pacing`)."""
    unconfirmed_per_s: float = 500.0
    """How many of those a second; a writer who goes on is slowed down, and loses nothing."""
    slow_reader_s: float = 2.0
    """A client that takes nothing for so long [s] is disconnected by its router: meanwhile all
    others wait for it. It comes back by itself, and asks for what it has missed."""

    def most_bytes(self, key: Key[Any, Any]) -> int:
        """How large a value of `key` may be."""
        return self.document_mb * 2**20 if is_document(key) else self.value_kb * 2**10

    def most_keys(self, key: Key[Any, Any]) -> int:
        """How many keys of this kind may have a value at the same time."""
        named = {"goal_spec": self.goals, "fact": self.facts}
        return named.get(key.name) or (self.documents if is_document(key) else self.keys)

    def most_of_one(self, key: Key[Any, Any]) -> int:
        """How many of them may be of one writer, so that nobody takes up all room."""
        most = self.most_keys(key)
        return most if is_document(key) else max(1, most // 2)

    @property
    def most_in_a_message(self) -> int:
        """The bytes of the largest message between two processes: a document quoted in an answer of
        the store."""
        return 2 * self.document_mb * 2**20 + 2**20


FIELDS = tuple(field.name for field in fields(Limits))


def is_document(key: Key[Any, Any]) -> bool:
    """Whether values of `key` are large by nature."""
    return key.of_processes or key.name in ("plan_proposal", "report")


def too_long(key: Key[Any, Any], size: int, limits: Limits | None = None) -> str | None:
    """Why a value of `size` bytes is not taken in, if it is not."""
    most = (limits or in_force()).most_bytes(key)
    if size <= most:
        return None
    return f"it has {size / 2**20:.3g} MiB, and a {key.name} has at most {most / 2**20:.3g}"


def too_many(key: Key[Any, Any], limits: Limits | None = None) -> str:
    """Why one more key of this kind is not taken in."""
    most = (limits or in_force()).most_keys(key)
    return f"there are {most} {key.name} keys, which is the most that is taken in: delete some"


def too_many_of_one(key: Key[Any, Any], own: int) -> str:
    """Why one more key of this kind is not taken in of somebody who has so many."""
    return f"its writer has {own} {key.name} keys, and nobody may have more than half of all"


class _InForce:
    limits = Limits()


def in_force() -> Limits:
    """The limits of this process."""
    return _InForce.limits


def put_in_force(limits: Limits) -> None:
    """Have other limits in this process from now on; for its main function."""
    _InForce.limits = limits
