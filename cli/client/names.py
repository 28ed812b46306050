"""Names and numbers that are chosen by looking what is taken, when others choose, too.

Nothing that somebody else has stored since one looked is overwritten: either the next free name is
tried, or a person hears of it.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from cli.errors import BadArgument
from keyexpr_schema.errors import InvalidId
from keyexpr_schema.ids import slug
from keyexpr_schema.key import A, Key, P
from keyexpr_schema.keyspace import CLAIM, OBJECT, PLACE, ROBOT_SPEC
from keyexpr_schema.payloads.world import Claim, ClaimAddress

if TYPE_CHECKING:
    from keyexpr_schema.transport.session import Session

CLAIMED_S = 15.0
"""How long a claim counts although nothing is stored that bears it out yet [s, wall]."""


class TakenMeanwhile(Exception):
    """Somebody else has stored a value since this one looked; `by` is that value, None: deleted."""

    def __init__(self, by: Any) -> None:
        super().__init__("somebody else has stored a value in the meantime")
        self.by = by


def free_name(text: str, taken: Iterable[str], kind: str, number: int = 2) -> str:
    """A name made from the words of `text` that is not one of `taken`; if need be, with the first
    number from `number` on that makes it so.

    Where no letter of it can stand in a name, as of Chinese, the name is `kind`.
    """
    used = set(taken)
    try:
        base = slug(text)
    except InvalidId:
        base = kind
    name = base
    while name in used:
        name = f"{base}-{number}"
        number += 1
    return name


async def put_if_unchanged(
    session: Session, key: Key[A, P], address: A, payload: P, seen: P | None
) -> None:
    """Store `payload`, confirmed, if there is still what was `seen` there (None: nothing).

    Raises:
        TakenMeanwhile: there is something else.
    """

    def unless_changed(now: P | None) -> P:
        if now != seen:
            raise TakenMeanwhile(now)
        return payload

    await session.update(key, address, unless_changed)


async def next_number(
    session: Session, of: str, kind: str, highest: int, *, returns: bool = True
) -> int:
    """The number after `highest`, or after those that others have been given just now; or, if none
    `returns` whatever is deleted, that were ever given."""

    def given(last: Claim | None) -> Claim:
        counts = last is not None and (not returns or _counts(last))
        taken = max(highest, last.number) if last is not None and counts else highest
        return Claim(number=taken + 1, wall_time_s=time.time())

    return (await session.update(CLAIM, ClaimAddress(of, kind), given)).number


async def claim_name(session: Session, name: str, kind: str) -> None:
    """Keep a name for a `kind` of thing until the thing is stored, or is not.

    Raises:
        BadArgument: somebody else is about to give it to something of another kind.
    """

    def claimed(last: Claim | None) -> Claim:
        if last is not None and last.kind != kind and _counts(last):
            raise BadArgument(
                f"somebody else has just taken {name!r} for a {last.kind}; choose another name"
            )
        return Claim(kind=kind, wall_time_s=time.time())

    await session.update(CLAIM, ClaimAddress("names", name), claimed)


async def check_free(session: Session, name: str, kind: str) -> None:
    """Do nothing where `name` stands for nothing of another kind ("place", "object" or "robot"),
    and nothing has one that is the same word in a sentence.

    Raises:
        BadArgument: it does.
    """
    places = [address.place for address in await session.list(PLACE)]
    objects = [address.object for address in await session.list(OBJECT)]
    robots = [address.robot for address in await session.list(ROBOT_SPEC)]
    for other, taken in (("a place", places), ("an object", objects), ("a robot", robots)):
        for same in (each for each in taken if each.casefold() == name.casefold()):
            if same != name or not other.endswith(kind):
                raise BadArgument(f"{same!r} is {other} already; choose another name")


def _counts(claim: Claim) -> bool:
    return abs(time.time() - claim.wall_time_s) < CLAIMED_S
