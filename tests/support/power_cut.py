"""What a real process leaves behind when it is killed and the power is cut at once."""

from __future__ import annotations

import os
import shutil
import signal
import sys
from pathlib import Path

import pytest

from benchmarks.chaos.power import compiled, set_back
from tests.support.child_process import blocking_child
from tests.support.polling import DEADLINE_S

KILL = "\nimport os\nos.kill(os.getpid(), 9)\n"


def cut(tmp_path: Path, program: str, *arguments: str) -> Path:
    """The folder of a Python program, its first argument, after a power cut at its end."""
    if shutil.which("cc") is None:
        pytest.skip("there is no C compiler")
    folder, notes, library = tmp_path / "data", tmp_path / "notes", tmp_path / "noted_syncs.so"
    folder.mkdir()
    notes.mkdir()
    assert compiled(library) is None
    environment = {**os.environ, "LD_PRELOAD": str(library), "CHAOS_SYNCS": str(notes)}
    with blocking_child(
        sys.executable, "-c", program + KILL, str(folder), *arguments, env=environment
    ) as process:
        assert process.wait(DEADLINE_S) == -signal.SIGKILL
    set_back(folder, notes)
    return folder


def was_synced(tmp_path: Path, path: Path) -> bytes | None:
    """What of a file was on the disk when it was synced last; `None`: it never was."""
    note = tmp_path / "notes" / f"{path}.whole".replace("/", "%")
    return note.read_bytes() if note.exists() else None
