"""How old is what was noted before the host was started again: `running_s` begins anew with it.

A journal has beside it what that clock showed together with the time of day when it was opened
last. So a word of yesterday is not taken for one of the first minute of today, which would be later
than what others have said in the night.
"""

from __future__ import annotations

import sqlite3
import time
from pathlib import Path
from typing import NamedTuple

from workers.host_clock import running_s

TABLE = """
CREATE TABLE IF NOT EXISTS boot (       -- of the host, when the journal was opened last
    id TEXT NOT NULL, running_s REAL NOT NULL, wall_s REAL NOT NULL
);
"""
_ID = Path("/proc/sys/kernel/random/boot_id")
_NOTED = ("outbox", "refused")
"""Tables with a `noted_s`."""


class Boot(NamedTuple):
    """Which start of the host this is ("": it does not say), how long it runs, and the time of day
    [s, Unix]."""

    id: str
    running_s: float
    wall_s: float

    @classmethod
    def now(cls) -> Boot:
        """This one."""
        try:
            name = _ID.read_text("ascii").strip()
        except OSError:
            name = ""
        return cls(name, running_s(), time.time())


def carry_over(db: sqlite3.Connection, now: Boot) -> None:
    """Put what was noted before the host was started again on the clock that runs now. It is as old
    as the time of day says, and no younger than that clock."""
    row = db.execute("SELECT id, running_s, wall_s FROM boot").fetchone()
    before = now if row is None else Boot(*row)
    if before.id != now.id or before.running_s > now.running_s:
        began_wall_s = before.wall_s - before.running_s
        for table in _NOTED:
            db.execute(
                f"UPDATE {table} SET noted_s = ? - max(?, ? - noted_s)",
                (now.running_s, now.running_s, now.wall_s - began_wall_s),
            )
    db.execute("DELETE FROM boot")
    db.execute("INSERT INTO boot VALUES (?, ?, ?)", now)
