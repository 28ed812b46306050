"""A power cut: what was not synced is gone, as `noted_syncs.c` has noted it."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

_WAL, _SHM = "-wal", "-shm"


def compiled(library: Path) -> str | None:
    """Make a library of the source of that name; why it cannot be made, or `None`."""
    source = Path(__file__).with_name(f"{library.stem}.c")
    command = ["cc", "-shared", "-fPIC", "-O1", "-o", str(library), str(source), "-ldl"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError as error:
        return f"there is no C compiler: {error}"
    return done.stderr.strip() if done.returncode else None


def set_back(folder: Path, notes: Path) -> int:
    """Take back what the files in the folder of a process that was killed had not synced; how
    many files are not as they were.

    A file is gone whose name was not in its folder when that was last synced, be it that this was
    never so. A log is as long as at its last sync; one of SQLite's that was begun anew since (after
    a checkpoint, for which the database was synced) is empty. Anything else is as at its last sync.
    What was never synced may have reached the disk all the same: it stays.
    """
    changed = 0
    for path in sorted(folder.rglob("*")):
        names = _note(notes, path.parent, "names")
        if path.is_file() and path.name.endswith(_SHM):
            path.unlink()  # memory, and no file of its own
        elif path.is_file() and (names is None or path.name not in names.decode().splitlines()):
            path.unlink()
            changed += 1
        elif path.is_file():
            changed += _set_back(path, notes)
    return changed


def _set_back(path: Path, notes: Path) -> bool:
    if (log := _note(notes, path, "length")) is not None:
        length, head = log.split()
        known = not path.name.endswith(_WAL) or _head(path) == bytes.fromhex(head.decode())
        synced = int(length) if known else 0
        if path.stat().st_size > synced:
            os.truncate(path, synced)
            return True
    elif path.name.endswith(_WAL):
        os.truncate(path, 0)
        return True
    elif (whole := _note(notes, path, "whole")) is not None and whole != path.read_bytes():
        with path.open("r+b") as file:  # in its place: the disk may be full
            file.write(whole)
            file.truncate()
        return True
    return False


def _head(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(32)


def _note(notes: Path, of: Path, kind: str) -> bytes | None:
    note = notes / f"{of}.{kind}".replace("/", "%")
    return note.read_bytes() if note.exists() else None
