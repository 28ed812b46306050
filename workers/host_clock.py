"""The clock of this host that nobody sets."""

from __future__ import annotations

import time


def running_s() -> float:
    """Seconds on a clock that nobody sets, and that goes on while the host sleeps, if there is
    one."""
    clock = getattr(time, "CLOCK_BOOTTIME", None)
    return time.monotonic() if clock is None else time.clock_gettime(clock)


def since(noted_s: float | None) -> float:
    """How long ago something was noted at `noted_s` by `running_s` [s]; of before the host began to
    run, at least so long ago."""
    now_s = running_s()
    return now_s - noted_s if noted_s is not None and noted_s <= now_s else now_s
