"""A power cut: what was not synced is gone."""

from __future__ import annotations

import os
from pathlib import Path

HOOK = Path(__file__).parent / "noting_syncs"
"""On the path of a process's modules it makes it note what it has synced."""


def set_back(folder: Path) -> int:
    """Take back, of the logs in the folder of a process that was killed, all that was not synced;
    the bytes that are gone.

    SQLite's log begins anew after a checkpoint, which SQLite has synced by itself; a length that
    was noted before is then no shorter than what was synced of the new one.
    """
    gone = 0
    for note in folder.rglob("*.synced-to"):
        log = note.with_name(note.name.removesuffix(".synced-to"))
        text = note.read_text(encoding="utf-8")
        if log.exists() and text and (too_long := log.stat().st_size - int(text)) > 0:
            os.truncate(log, int(text))
            gone += too_long
    return gone
