"""What is known of a running `robotctl up`, one for each realm, in the user's state folder."""

from __future__ import annotations

import asyncio
import fcntl
import os
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import msgspec

from cli.errors import BadArgument
from cli.processes.identity import ProcessId
from keyexpr_schema.decoding import decode
from keyexpr_schema.private_files import open_private, private_folder, write_private

LOOK_S = 0.1
BEGUN_S = 20.0
"""How long a mission's files may take to be read, before `up` says that it has begun."""
LOCK_S = 1.0
"""Who only looks whether the lock is held has it for a moment."""


class Child(msgspec.Struct, frozen=True, kw_only=True):
    """One process, last started at `since_wall_s` [s, Unix]. No `process`: it has ended."""

    name: str
    process: ProcessId | None
    since_wall_s: float | None
    restarts: int
    log: str


class UpState(msgspec.Struct, frozen=True, kw_only=True):
    """One `robotctl up`: where its router listens, its folder, its processes.

    `ready`: every process has shown that it is there. `zenoh_config`: what connects to it needs
    that Zenoh configuration.
    """

    process: ProcessId | None
    since_wall_s: float
    endpoint: str
    realm: str
    folder: str
    mission: str | None
    ready: bool
    children: tuple[Child, ...]
    zenoh_config: str | None = None


def state_folder(realm: str, environ: Mapping[str, str] = os.environ) -> Path | None:
    """Where a realm's `up` keeps its state; `None` where there is no home."""
    state, home = environ.get("XDG_STATE_HOME"), environ.get("HOME")
    if not state and not home:
        return None
    return Path(state or Path(home or "") / ".local" / "state") / "robotfleet" / realm


def read_state(folder: Path) -> UpState | None:
    """What the latest `up` wrote, whether it still runs or not; `None` if none ever did."""
    try:
        return decode(_file(folder).read_bytes(), UpState)
    except (OSError, msgspec.MsgspecError):
        return None


def write_state(folder: Path, state: UpState) -> None:
    """Replace it in one step: who reads sees the one or the other."""
    write_private(_file(folder), msgspec.json.format(msgspec.json.encode(state), indent=2))


def running_state(folder: Path | None) -> UpState | None:
    """What the `up` that runs now has written; `None` if none runs."""
    if folder is None or not _is_locked(folder):
        return None
    state = read_state(folder)
    # Between taking the lock and writing, a new one has said nothing yet.
    return state if state and state.process and state.process.alive else None


def begun(folder: Path, process: ProcessId | None, realm: str, mission: str | None) -> None:
    """Write that an `up` is being started: who ends it before it says something itself finds it."""
    state = UpState(
        process=process,
        since_wall_s=time.time(),
        endpoint="",
        realm=realm,
        folder=str(folder),
        mission=mission,
        ready=False,
        children=(),
    )
    write_state(folder, state)


async def begun_state(folder: Path, wait_s: float = BEGUN_S) -> UpState | None:
    """What the latest `up` wrote; one that has begun and says nothing yet is waited for so long."""
    give_up_at = time.monotonic() + wait_s
    # A file cannot be awaited, so it is looked at.
    while _is_locked(folder) and running_state(folder) is None:
        await asyncio.sleep(LOOK_S)
        if time.monotonic() >= give_up_at:
            break
    return read_state(folder)


@contextmanager
def only_up(folder: Path, realm: str) -> Iterator[None]:
    """Be the only `up` of the realm in the block.

    Raises:
        BadArgument: one runs, or the folder cannot be used.
    """
    try:
        private_folder(folder)
        opened = open_private(_lock_file(folder), os.O_RDWR)
    except OSError as error:
        raise BadArgument(f"{folder} cannot be used: {error.strerror or error}") from None
    with os.fdopen(opened, "rb+") as lock:
        give_up_at = time.monotonic() + LOCK_S
        while not _taken(lock.fileno(), fcntl.LOCK_EX):
            if time.monotonic() < give_up_at:
                time.sleep(0.05)
                continue
            there = read_state(folder)
            pid = (
                f" (pid {there.process.pid})"
                if there and there.process and there.process.alive
                else ""
            )
            raise BadArgument(
                f"a fleet is up in realm {realm} already{pid}: see `robotctl ps`, end it with "
                "`robotctl down`, or use another --realm"
            )
        yield


def _is_locked(folder: Path) -> bool:
    try:
        with _lock_file(folder).open("r") as lock:
            return not _taken(lock.fileno(), fcntl.LOCK_SH)
    except OSError:
        return False


def _taken(lock: int, kind: int) -> bool:
    try:
        fcntl.flock(lock, kind | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _file(folder: Path) -> Path:
    return folder / "up.json"


def _lock_file(folder: Path) -> Path:
    return folder / "up.lock"
