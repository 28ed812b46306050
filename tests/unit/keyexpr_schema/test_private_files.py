"""What processes keep is their owner's alone, and no symbolic link leads them anywhere else."""

from __future__ import annotations

import logging
import os
import stat
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from cli.certificates.authority import Authority
from cli.errors import CliError
from cli.processes.run_folder import claim_run_folder
from cli.processes.up_state import only_up, write_private
from fleet.errors import FleetError
from fleet.history.archive import Archive
from fleet.history.audit_log import AuditLog
from fleet.service.event_journal import EventJournal
from fleet.stores.sqlite import SqliteStore
from fleet.timeline.drawing.sink import open_stream
from fleet.timeline.errors import TimelineError
from keyexpr_schema.private_files import (
    NotPrivate,
    open_private,
    private_database,
    private_file,
    private_folder,
    usable_folder,
)
from workers.errors import WorkerError
from workers.orders.journal import Journal


def rights(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


@pytest.fixture(autouse=True)
def generous_umask():
    before = os.umask(0)
    yield
    os.umask(before)


def planner(folder: Path) -> None:
    with EventJournal(folder), Archive(folder), AuditLog(folder):
        pass


def recording(folder: Path) -> None:
    open_stream(folder / "r.rrd", "test").disconnect()


def up(folder: Path) -> None:
    with only_up(folder, "test"):
        write_private(folder / "up.log", b"")


def worker(folder: Path) -> None:
    with Journal(folder / "hsr.sqlite"):
        pass


def store(folder: Path) -> None:
    SqliteStore(folder).close()


KEEPERS: dict[str, Callable[[Path], object]] = {
    "store": store,
    "planner": planner,
    "worker": worker,
    "recorder": recording,
    "up": up,
    "run": claim_run_folder,
    "certificates": lambda folder: Authority.create(folder, "test"),
}


@pytest.mark.parametrize("who", KEEPERS)
def test_whoever_keeps_something_keeps_it_to_himself(who: str, tmp_path: Path) -> None:
    folder = tmp_path / "share" / who
    KEEPERS[who](folder)
    made = [tmp_path / "share", *tmp_path.rglob("*")]
    assert len(made) > 2
    wide = {str(path): oct(rights(path)) for path in made if rights(path) & 0o077}
    assert wide == {}


@pytest.mark.parametrize("who", KEEPERS)
def test_nobody_keeps_anything_where_a_symbolic_link_leads(who: str, tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (tmp_path / "link").symlink_to(elsewhere)
    if who == "recorder":  # its folder is whichever somebody names, and its file is what matters
        (elsewhere / "r.rrd").symlink_to(tmp_path / "target")
    with pytest.raises((FleetError, WorkerError, CliError, TimelineError), match="symbolic link"):
        KEEPERS[who](tmp_path / "link")
    assert not (tmp_path / "target").exists()
    assert [each for each in elsewhere.iterdir() if not each.is_symlink()] == []


@pytest.mark.parametrize("name", ["state.sqlite", "state.sqlite-wal", "lock", "synced"])
def test_a_file_that_is_a_link_is_neither_written_nor_opened(name: str, tmp_path: Path) -> None:
    target = tmp_path / "target"
    target.write_bytes(b"precious")
    (tmp_path / "store").mkdir(0o700)
    (tmp_path / "store" / name).symlink_to(target)
    with pytest.raises(FleetError, match="symbolic link"):
        store(tmp_path / "store")
    assert target.read_bytes() == b"precious"


def test_what_an_earlier_version_left_open_is_closed(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    folder = tmp_path / "store"
    store(folder)
    folder.chmod(0o755)
    (folder / "state.sqlite").chmod(0o644)
    (folder / "lock").chmod(0o664)
    with caplog.at_level(logging.WARNING):
        store(folder)
    assert f"{folder} was open to others, and is not any more" in caplog.text
    assert {rights(path) for path in folder.iterdir()} == {0o600}
    assert rights(folder) == 0o700


def test_a_folder_of_other_things_is_left_as_it_is_and_its_owner_told(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    folder = tmp_path / "home"
    folder.mkdir(mode=0o755)
    (folder / "letter.txt").touch(mode=0o644)
    with caplog.at_level(logging.WARNING):
        store(folder)
    assert f"close it with: chmod 700 {folder}" in caplog.text
    assert rights(folder) == 0o755
    assert rights(folder / "letter.txt") == 0o644
    assert rights(folder / "state.sqlite") == 0o600


def test_a_folder_that_cannot_be_used_is_told_in_a_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with (
        pytest.raises(FleetError, match="it is no directory; name one"),
        usable_folder(tmp_path / "file", "store's", FleetError),
    ):
        pass
    (tmp_path / "pipe").mkdir()
    os.mkfifo(tmp_path / "pipe" / "fifo")
    with pytest.raises(NotPrivate):
        private_file(tmp_path / "pipe" / "fifo")


def test_a_file_that_is_replaced_was_never_open_to_others(tmp_path: Path) -> None:
    path = tmp_path / "state"
    path.touch(mode=0o644)
    (tmp_path / ".state.new").symlink_to(tmp_path / "target")
    write_private(path, b"new")
    assert (path.read_bytes(), rights(path)) == (b"new", 0o600)
    assert not (tmp_path / "target").exists()
    with closing(os.fdopen(open_private(path, os.O_WRONLY | os.O_APPEND), "ab")) as file:
        file.write(b"er")
    assert path.read_bytes() == b"newer"
    assert private_database(path) == path
    assert private_folder(tmp_path / "deep" / "er") == tmp_path / "deep" / "er"
    assert rights(tmp_path / "deep") == 0o700
