"""Which of the values that somebody could not read are still there."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from keyexpr_schema.errors import ForeignKey, UndecodablePayload
from keyexpr_schema.keyspace import key_of
from keyexpr_schema.payloads.service import UndecodableValue

if TYPE_CHECKING:
    from keyexpr_schema.transport.session import Session

ASK_S = 3.0


async def current_rejects(
    session: Session, rejects: Iterable[UndecodableValue]
) -> list[UndecodableValue]:
    """Those whose key still has a value that does not decode.

    A reject stays on its key when the bad value is replaced or deleted. What is not stored, and
    what was put on a key that nobody can have, cannot be looked at again and stays listed.
    """
    left = []
    for reject in rejects:
        try:
            key = key_of(reject.keyexpr)
        except ForeignKey:
            left.append(reject)
            continue
        if not key.stored:
            left.append(reject)
            continue
        try:
            await session.get(key, key.parse(reject.keyexpr), ASK_S)
        except UndecodablePayload:
            left.append(reject)
    return left
