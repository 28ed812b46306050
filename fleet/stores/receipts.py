"""In which order a store has received things, by its own count and nobody's claim.

Receipts are microseconds that only rise: they begin with the time of day and go on with a clock
that nobody sets, from wherever they were before. What a writer has held back, because no router was
there, counts as received that much earlier, and yet after what the same session wrote of it before:
how long that one was on its way nobody has counted. So the receipts of a key only rise, and whoever
watches it can tell by them what is older.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from keyexpr_schema.transport.stamps import same_session
from keyexpr_schema.transport.store.storage import Write, is_by_receipt


class ReceiptClock:
    """Gives receipts [µs] above `last`, the highest that was given before."""

    def __init__(
        self, last: int, wall_time_s: float, monotonic_ns: Callable[[], int] = time.monotonic_ns
    ) -> None:
        self._monotonic_ns = monotonic_ns
        self._ahead = max(last + 1, int(wall_time_s * 1e6)) - monotonic_ns() // 1000
        self._last = last

    def now(self) -> int:
        """A receipt above all others."""
        self._last = max(self._last + 1, self._monotonic_ns() // 1000 + self._ahead)
        return self._last

    def of(self, write: Write, known: Write | None) -> int:
        """The receipt of a write, `known` being the newest of its key."""
        receipt = max(1, (write.received or self.now()) - write.late_us)
        if (
            known is None
            or write.stamp <= known.stamp
            or not same_session(write.stamp, known.stamp)
        ):
            return receipt
        return max(receipt, known.received + 1)


def holds(write: Write, known: Write | None) -> bool:
    """Whether `write` takes the place of what is known of its key.

    The later stamp wins. Where the key goes by receipt that holds only of what one session has
    written, whose clock is its own; of what different ones have, the one received later wins.
    """
    if known is None:
        return True
    if same_session(write.stamp, known.stamp) or not is_by_receipt(write.keyexpr):
        return write.stamp > known.stamp
    return write.received > known.received
