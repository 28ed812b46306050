"""Files that are written whole or not at all, and are on the disk when that was said."""

from __future__ import annotations

import errno
import os
import stat
from contextlib import suppress
from pathlib import Path


def write_whole(path: Path, data: bytes) -> None:
    """Make a file that people read and edit, or replace it as `put_in_place` does.

    Its rights stay, and a symbolic link goes on to lead to it.

    Raises:
        OSError: it cannot be written; its `filename` is `path`.
    """
    target = path.resolve()
    try:
        if target.exists() and not target.is_file():  # a pipe, say
            target.write_bytes(data)
            return
        rights = stat.S_IMODE(target.stat().st_mode) if target.exists() else None
        flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC
        opened = os.open(beside_of(target), flags, 0o666)
        put_in_place(target, opened, data, rights)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from None


def make_folder(folder: Path) -> None:
    """Make a folder where there is none, and those that it is in.

    Raises:
        OSError: it cannot be made.
    """
    for each in reversed((folder, *folder.parents)):
        if not each.exists():
            each.mkdir(exist_ok=True)
            sync_folder(each.parent)


def beside_of(path: Path) -> Path:
    """Where what replaces a file is written."""
    return path.with_name(f"{path.name}.new")


def put_in_place(path: Path, opened: int, data: bytes, rights: int | None = None) -> None:
    """Write `data` to `opened`, a descriptor of `beside_of(path)`, and have it replace the file in
    one step, with these rights if they are given.

    Who reads sees the one or the other, also after a power cut, and after this returns the new one.

    Raises:
        OSError: it cannot be written; the one before is as it was, and nothing is left beside it.
    """
    beside = beside_of(path)
    try:
        with os.fdopen(opened, "wb") as file:
            if rights is not None:
                os.fchmod(opened, rights)
            file.write(data)
            file.flush()
            os.fsync(opened)
        beside.replace(path)
    except OSError:
        with suppress(OSError):
            beside.unlink(missing_ok=True)
        raise
    sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Have on the disk which files are in a folder: those that were made in it, moved, or deleted.

    Some file systems of a network do that by themselves, and cannot be asked.

    Raises:
        OSError: the system cannot say so.
    """
    try:
        opened = os.open(folder, os.O_RDONLY | os.O_CLOEXEC)
    except PermissionError:  # one may write in it, and not list it
        return
    try:
        os.fsync(opened)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):
            raise
    finally:
        os.close(opened)
