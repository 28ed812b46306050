"""What a power cut of the chaos run takes back: whatever a real process did not sync."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

from tests.support.power_cut import cut

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
"""


def kept(folder: Path) -> list[int]:
    with closing(sqlite3.connect(folder / "a.db")) as db:
        return [x for (x,) in db.execute("SELECT x FROM t")]


def test_what_was_synced_is_kept_and_nothing_else(tmp_path: Path) -> None:
    folder = cut(tmp_path, WRITES, "insert(1)", "sync()", "folder_synced()", "insert(2)")
    assert kept(folder) == [1]


def test_a_log_that_was_begun_anew_after_a_checkpoint_is_lost_and_the_checkpoint_is_not(
    tmp_path: Path,
) -> None:
    steps = ("insert(1)", "folder_synced()", "checkpoint()", "insert(2)")
    assert kept(cut(tmp_path, WRITES, *steps)) == [1]


def test_a_name_that_was_not_synced_is_lost(tmp_path: Path) -> None:
    steps = ("new('a')", "folder_synced()", "new('b')", "insert(1)", "sync()")
    folder = cut(tmp_path, WRITES, *steps)
    assert (folder / "a").exists()
    assert not (folder / "b").exists()
