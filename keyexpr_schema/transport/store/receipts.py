"""In which order writes of one key count, for who judges them and for who keeps them alike.

The later stamp wins. Of keys that go by receipt that holds only of what one session has written,
whose clock is its own; of what different ones have, the one received later wins. What a writer has
held back, because no router was there, counts as received that much earlier, and yet after what the
same session wrote of it before: how long that one was on its way nobody has counted. So the
receipts of a key only rise, and whoever watches it can tell by them what is older.
"""

from __future__ import annotations

from msgspec import structs

from keyexpr_schema.transport.stamps import same_session
from keyexpr_schema.transport.store.storage import Write, is_by_receipt


def successor(write: Write, known: Write | None) -> Write | None:
    """`write` with its receipt, if it takes the place of what is `known` of its key."""
    receipt = max(1, write.received - write.late_us)
    if known is not None:
        same = same_session(write.stamp, known.stamp)
        if same or not is_by_receipt(write.keyexpr):
            if write.stamp <= known.stamp:
                return None
        elif receipt <= known.received:
            return None
        if same:
            receipt = max(receipt, known.received + 1)
    return structs.replace(write, received=receipt)
