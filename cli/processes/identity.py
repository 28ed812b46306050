"""Which process a number means: pids are given out again, and what got one is somebody else's."""

from __future__ import annotations

import os
import signal
import subprocess
from pathlib import Path

import msgspec

PROC = Path("/proc")
_STARTED = 22 - 3
"""`starttime` in `/proc/PID/stat` (proc(5)), counted from the state, which follows the name."""


class ProcessId(msgspec.Struct, frozen=True):
    """A process by its number and by when it began, in the system's own words."""

    pid: int
    born: str

    @classmethod
    def of(cls, pid: int) -> ProcessId | None:
        """The process that has this number now; `None` if none has, or it has ended."""
        born = _born(pid)
        return None if born is None else cls(pid, born)

    @property
    def alive(self) -> bool:
        """Whether it runs still."""
        return _born(self.pid) == self.born

    def send(self, signum: signal.Signals) -> bool:
        """Signal it, and no other; whether it was there.

        Raises:
            PermissionError: it is another user's.
        """
        if not hasattr(os, "pidfd_open"):
            if not self.alive:
                return False
            try:
                os.kill(self.pid, signum)
            except ProcessLookupError:
                return False
            return True
        try:
            held = os.pidfd_open(self.pid)
        except ProcessLookupError:
            return False
        try:
            # What is held cannot become another process between this look and the signal.
            if not self.alive:
                return False
            signal.pidfd_send_signal(held, signum)
        except ProcessLookupError:
            return False
        finally:
            os.close(held)
        return True


def _born(pid: int) -> str | None:
    if not PROC.joinpath("self", "stat").exists():
        asked = subprocess.run(
            ["ps", "-o", "lstart=", "-p", str(pid)], capture_output=True, text=True, check=False
        )
        return asked.stdout.strip() or None
    try:
        told = PROC.joinpath(str(pid), "stat").read_text(encoding="utf-8", errors="replace")
        boot = PROC.joinpath("sys", "kernel", "random", "boot_id").read_text(encoding="ascii")
    except OSError:
        return None
    state, *fields = told.rpartition(")")[2].split()
    if state in "ZX":
        return None
    return f"{boot.strip()}/{fields[_STARTED - 1]}"
