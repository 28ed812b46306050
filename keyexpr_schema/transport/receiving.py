"""Zenoh's threads that read links."""

from __future__ import annotations

import os
import re

_VARIABLE = "ZENOH_RUNTIME"
"""Where Zenoh looks for the numbers of its threads, once, when it needs the first of them."""
THREADS = 64
"""A thread that has nothing to do costs some kB, and no time."""
_OF_ZENOH = 2


def spread_receiving() -> None:
    """Have links read by so many threads that some of them may wait; to be called by a router's
    main function before it opens a session. Whoever has set the variable himself is obeyed."""
    os.environ.setdefault(_VARIABLE, f"(rx: (worker_threads: {THREADS}))")


def most_held() -> int:
    """How many links may be held at a time, such that all others are read."""
    said = re.search(r"rx:\s*\([^)]*worker_threads:\s*(\d+)", os.environ.get(_VARIABLE, ""))
    threads = _OF_ZENOH if said is None else int(said[1])
    return threads * 3 // 4
