"""Folders and files that nobody but their owner reads: stores, journals, recordings, logs.

Folders get 0700 and files 0600, whatever the umask says, and no symbolic link is followed: where
others may write, one that leads somewhere else could have been put there by anybody. What an
earlier version left open to others is closed, if it is ours; a folder that holds other things, such
as a home, is left as it is, and its owner told.
"""

from __future__ import annotations

import logging
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from keyexpr_schema.whole_files import beside_of, put_in_place, sync_folder

FOLDER, FILE = 0o700, 0o600
OTHERS = 0o077
_SAFE = os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC | os.O_NONBLOCK  # which a pipe would block
_BESIDE = ("-wal", "-shm", "-journal")
"""What SQLite keeps beside a database; it gives these the rights of the database itself."""

_log = logging.getLogger(__name__)


class NotPrivate(OSError):
    """A folder or a file would be no place to keep something in; the message says why."""

    def __init__(self, path: Path, why: str) -> None:
        super().__init__(f"it {why}")
        self.strerror = f"it {why}"
        self.path = path


def private_folder(folder: Path) -> Path:
    """The folder, made with 0700 if there is none; its parents, too.

    One that is there and that others may enter is closed if it is empty or was ours before, and
    otherwise left as it is, with a warning.

    Raises:
        NotPrivate: it is a symbolic link, or somebody else's.
        OSError: it cannot be made.
    """
    for each in reversed((folder, *folder.parents)):
        if not each.exists() and not each.is_symlink():
            each.mkdir(mode=FOLDER, exist_ok=True)
            sync_folder(each.parent)
            if each == folder:
                return folder
    found = folder.lstat()
    if stat.S_ISLNK(found.st_mode):
        raise NotPrivate(folder, "is a symbolic link: name the folder that it leads to")
    if not stat.S_ISDIR(found.st_mode):
        raise NotADirectoryError(f"{folder} is no directory")
    if found.st_uid not in (os.geteuid(), 0):
        raise NotPrivate(folder, "belongs to somebody else, who could replace what is in it")
    if not found.st_mode & OTHERS:
        return folder
    if found.st_uid == os.geteuid() and _is_ours(folder):
        folder.chmod(FOLDER)
        _log.warning("%s was open to others, and is not any more", folder)
    else:
        _log.warning(
            "%s is open to others, who see which files are in it; those that are made now are "
            "closed to them; close it with: chmod 700 %s",
            *(folder, folder),
        )
    return folder


def _is_ours(folder: Path) -> bool:
    """Whether nothing is in it but what processes of a fleet make."""
    return all(
        each.name in _OURS or each.name.startswith(_OURS_BEGIN) or each.suffix in _OURS_END
        for each in folder.iterdir()
    )


_OURS = frozenset(
    {"lock", "synced", "audit.jsonl", "failed-planning-jobs", "data", "store", "up.json", "up.lock"}
)
_OURS_BEGIN = ("state.sqlite", "events.db", "archive.db", "orders", "snapshot-")
_OURS_END = frozenset({".log", ".rrd", ".db", ".sqlite"})


def private_file(path: Path) -> Path:
    """The file, made empty with 0600 if there is none; one that others may read is closed.

    Raises:
        NotPrivate: it is a symbolic link, or something else than a file.
        OSError: it cannot be made or opened.
    """
    os.close(open_private(path, os.O_RDWR))
    return path


def private_database(path: Path) -> Path:
    """The file of an SQLite database, as `private_file`; also what lies beside it.

    Raises:
        NotPrivate, OSError: as `private_file`.
    """
    for beside in _BESIDE:
        if (other := path.with_name(path.name + beside)).exists() or other.is_symlink():
            private_file(other)
    return private_file(path)


def open_private(path: Path, flags: int) -> int:
    """A descriptor of the file, which is made with 0600 if there is none.

    Raises:
        NotPrivate: it is a symbolic link, or something else than a file.
        OSError: it cannot be made or opened.
    """
    try:
        opened = os.open(path, flags | _SAFE, FILE)
    except OSError:
        if path.is_symlink():
            raise NotPrivate(path, "is a symbolic link: name the file that it leads to") from None
        if path.is_dir():
            raise NotPrivate(path, "is a folder and no file") from None
        raise
    try:
        found = os.fstat(opened)
        if not stat.S_ISREG(found.st_mode):
            raise NotPrivate(path, "is no file")
        if found.st_mode & OTHERS and found.st_uid == os.geteuid():
            os.fchmod(opened, FILE)
    except BaseException:
        os.close(opened)
        raise
    return opened


def write_private(path: Path, data: bytes) -> None:
    """Make the file with 0600, or replace it as `put_in_place` does.

    Raises:
        OSError: it cannot be written; the one before is as it was.
    """
    beside = beside_of(path)
    beside.unlink(missing_ok=True)
    put_in_place(path, open_private(beside, os.O_WRONLY | os.O_EXCL), data)


@contextmanager
def usable_folder(folder: Path, whose: str, error: type[Exception]) -> Iterator[None]:
    """Make the folder, where there is none; in the block, files in it are opened.

    Raises:
        error: the folder or the files cannot be used; one sentence says whose folder it is, why
            and what to do.
    """
    try:
        private_folder(folder)
        yield
    except OSError as reason:
        why = "it is no directory" if folder.is_file() else reason.strerror or reason
        if isinstance(reason, NotPrivate) and reason.path != folder:
            why = f"{reason.path.name} in it, {why}"
        raise error(
            f"the {whose} directory {folder} cannot be used: {why}; "
            "name one that can be written with --data"
        ) from None
