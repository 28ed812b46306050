"""In which order a store has received things, by its own count and nobody's claim.

Receipts are microseconds that only rise: they begin with the time of day and go on with a clock
that nobody sets, from wherever they were before. Which write of a key holds by them:
`keyexpr_schema.transport.store.receipts`.
"""

from __future__ import annotations

import time
from collections.abc import Callable


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
