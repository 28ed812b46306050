"""What a power cut of the chaos run takes back: whatever a real process did not sync."""

from __future__ import annotations

import os
import shutil
import signal
import sqlite3
import sys
from contextlib import closing
from pathlib import Path

import pytest

from benchmarks.chaos.power import compiled, set_back
from tests.support.child_process import blocking_child
from tests.support.polling import DEADLINE_S

WRITES = """
import os, sqlite3, sys
folder = sys.argv[1]
db = sqlite3.connect(f"{folder}/a.db", isolation_level=None)
db.execute("PRAGMA journal_mode=WAL")
db.execute("PRAGMA synchronous=NORMAL")
db.execute("CREATE TABLE t (x)")
log = os.open(f"{folder}/a.db-wal", os.O_RDWR)
def insert(x): db.execute("INSERT INTO t VALUES (?)", (x,))
def sync(): os.fdatasync(log)
def checkpoint(): db.execute("PRAGMA wal_checkpoint(RESTART)").fetchall()
def folder_synced(): os.fsync(os.open(folder, os.O_RDONLY))
def new(name): open(f"{folder}/{name}", "w").write("new")
for step in sys.argv[2:]: eval(step)
os.kill(os.getpid(), 9)
"""


def cut(tmp_path: Path, *steps: str) -> Path:
    """The folder of a process that did this, after a power cut."""
    if shutil.which("cc") is None:
        pytest.skip("there is no C compiler")
    folder, notes, library = tmp_path / "data", tmp_path / "notes", tmp_path / "noted_syncs.so"
    folder.mkdir()
    notes.mkdir()
    assert compiled(library) is None
    environment = {**os.environ, "LD_PRELOAD": str(library), "CHAOS_SYNCS": str(notes)}
    with blocking_child(
        sys.executable, "-c", WRITES, str(folder), *steps, env=environment
    ) as process:
        assert process.wait(DEADLINE_S) == -signal.SIGKILL
    set_back(folder, notes)
    return folder


def kept(folder: Path) -> list[int]:
    with closing(sqlite3.connect(folder / "a.db")) as db:
        return [x for (x,) in db.execute("SELECT x FROM t")]


def test_what_was_synced_is_kept_and_nothing_else(tmp_path: Path) -> None:
    folder = cut(tmp_path, "insert(1)", "sync()", "folder_synced()", "insert(2)")
    assert kept(folder) == [1]


def test_a_log_that_was_begun_anew_after_a_checkpoint_is_lost_and_the_checkpoint_is_not(
    tmp_path: Path,
) -> None:
    steps = ("insert(1)", "folder_synced()", "checkpoint()", "insert(2)")
    assert kept(cut(tmp_path, *steps)) == [1]


def test_a_name_that_was_not_synced_is_lost(tmp_path: Path) -> None:
    steps = ("new('a')", "folder_synced()", "new('b')", "insert(1)", "sync()")
    folder = cut(tmp_path, *steps)
    assert (folder / "a").exists()
    assert not (folder / "b").exists()
