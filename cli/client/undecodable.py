"""Which of the values that somebody could not read are still there."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from keyexpr_schema.errors import ForeignKey, UndecodablePayload
from keyexpr_schema.keyspace import key_of
from keyexpr_schema.payloads.system import UndecodableValue

if TYPE_CHECKING:
    from keyexpr_schema.transport.session import Session

ASK_S = 3.0


async def still_undecodable(
    session: Session, values: Iterable[UndecodableValue]
) -> list[UndecodableValue]:
    """Those whose key still has a value that does not decode.

    The report stays on its key when the bad value is replaced or deleted. What is not stored, and
    what was put on a key that nobody can have, cannot be looked at again and stays listed.
    """
    left = []
    for value in values:
        try:
            key = key_of(value.keyexpr)
            if key.stored:
                await session.get(key, key.parse(value.keyexpr), ASK_S)
                continue
        except (ForeignKey, UndecodablePayload):
            pass
        left.append(value)
    return left
