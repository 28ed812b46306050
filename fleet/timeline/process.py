"""The recorder as a process: watches keys of a realm until a signal ends it."""

from __future__ import annotations

import asyncio
import os
import secrets
import subprocess
import sys
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from time import time
from typing import Any

from fleet.timeline import viewer
from fleet.timeline.drawing.sink import any_given_up
from fleet.timeline.errors import NoPicture
from fleet.timeline.pieces import Pieces
from fleet.timeline.recorder import RECORDED, Recorder
from fleet.timeline.rolling import Rolling
from keyexpr_schema.errors import SchemaError
from keyexpr_schema.free_ports import free_port
from keyexpr_schema.full_disk import RETRY_S
from keyexpr_schema.keyspace import DIAGNOSTIC, RECORDER_ALIVE
from keyexpr_schema.payloads.system import Diagnostic, DiagnosticAddress, RecorderAliveAddress
from keyexpr_schema.signals import run_until_signal
from keyexpr_schema.transport.session import Change, Session, SessionConfig, Watch, open_session

FLUSH_S = 1.0
"""How much wall time of events a SIGKILL may cost."""

POSES_S = 5.0
"""How much wall time of poses it may cost; larger pieces make a smaller file."""

LIVE_FLUSH_S = 0.25
"""Both with a viewer looking on."""

BACKLOG_S = 2.0
"""Values are put in the order of their timestamps for so long, if they do not cease before."""

COLLECT_S = 0.1
"""Values are taken together, every so often: nobody waits for them."""

IDLE_S = 2 * COLLECT_S

DISK = "disk"
"""The check of the recorder's diagnostic."""


def _print_line(sentence: str) -> None:
    sys.stdout.write(f"{sentence}\n")
    sys.stdout.flush()


def run_recorder(
    endpoints: Sequence[str],
    realm: str,
    out: Path,
    view: bool = False,
    connect_timeout_s: float | None = 3.0,
    rolling: Rolling | None = None,
    zenoh_config: Path | None = None,
) -> None:
    """Record a realm to `out` until SIGTERM or SIGINT; then close the file.

    With `view` Rerun's viewer is opened on what is being recorded, where there is a screen. With
    `rolling` a new file is begun now and then, and `out` is what their names begin with.

    Raises:
        Unreachable: no router answers at the endpoints.
        UnwritableRecording: the file cannot be written.
    """
    config = SessionConfig(
        endpoints=tuple(endpoints),
        realm=realm,
        component="recorder",
        connect_timeout_s=connect_timeout_s,
        zenoh_config=zenoh_config,
    )
    run_until_signal(_record(config, out, view, rolling))
    if any_given_up():
        sys.stdout.flush()
        os._exit(0)


async def _record(config: SessionConfig, out: Path, view: bool, rolling: Rolling | None) -> None:
    shown: subprocess.Popen[bytes] | None = None
    try:
        async with open_session(config) as session, _diagnosed(session) as diagnosis:
            port = free_port() if view else None
            name = f"{config.realm} · {out.stem}"
            pieces = Pieces(out, name, rolling, _print_line, diagnosis.tell)
            recorder = Recorder(pieces.first(port))
            if port is not None:
                shown = _show(port)
            try:
                async with (
                    session.token(RECORDER_ALIVE, RecorderAliveAddress(secrets.token_hex(6))),
                    session.watch(*RECORDED, collect_s=COLLECT_S) as watch,
                ):
                    _print_line(f"recording to {pieces.begins_with}")
                    await _follow(watch, recorder, view, pieces)
            finally:
                pieces.close(recorder)
    finally:
        if shown is not None:
            viewer.end(shown)


class _Diagnosis:
    """What is wrong with the recorder, on a key that people look at."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._address = DiagnosticAddress(session.config.component, DISK)
        self._sentence: str | None = None
        self._changed = asyncio.Event()

    def tell(self, sentence: str | None) -> None:
        """Say so, or (None) that all is well."""
        self._sentence = sentence
        self._changed.set()

    async def publish(self) -> None:
        """Keep the key up to date, for ever; what an earlier run left is taken back."""
        there = bool(await self._session.list(DIAGNOSTIC, component=self._address.component))
        while True:
            self._changed.clear()
            try:
                if self._sentence is not None or there:
                    await self._put(self._sentence)
                    there = self._sentence is not None
            except SchemaError:
                await self._session.wait_connected()
                await asyncio.sleep(RETRY_S)
            else:
                await self._changed.wait()

    async def end(self) -> None:
        """Take back what was said, if the store answers soon."""
        if self._sentence is not None:
            with suppress(SchemaError):
                await self._session.delete(DIAGNOSTIC, self._address, RETRY_S)

    async def _put(self, sentence: str | None) -> None:
        if sentence is None:
            await self._session.delete(DIAGNOSTIC, self._address)
            return
        component, check = self._address.component, self._address.check
        found = Diagnostic(component=component, check=check, sentence=sentence, since_s=time())
        await self._session.confirm(DIAGNOSTIC, self._address, found)


@asynccontextmanager
async def _diagnosed(session: Session) -> AsyncIterator[_Diagnosis]:
    diagnosis = _Diagnosis(session)
    publishing = asyncio.create_task(diagnosis.publish())
    try:
        yield diagnosis
    finally:
        publishing.cancel()
        await asyncio.gather(publishing, return_exceptions=True)
        await diagnosis.end()


async def _follow(watch: Watch, recorder: Recorder, live: bool, pieces: Pieces) -> None:
    """Hand changes to the recorder until cancelled; what was stored first, as it was written."""
    loop = asyncio.get_running_loop()
    inbox = _Inbox(recorder)
    flush_s, poses_s = (LIVE_FLUSH_S, LIVE_FLUSH_S) if live else (FLUSH_S, POSES_S)
    poses_at = loop.time() + poses_s
    taking = asyncio.create_task(inbox.take(watch))
    settling = asyncio.create_task(inbox.settle(watch))
    try:
        while not taking.done():
            await asyncio.wait({taking}, timeout=flush_s)
            whole = loop.time() >= poses_at
            pieces.flush(recorder, whole)
            if whole:
                poses_at = loop.time() + poses_s
        taking.result()
    finally:
        inbox.settled()
        for task in (taking, settling):
            task.cancel()
        await asyncio.gather(taking, settling, return_exceptions=True)


class _Inbox:
    """Changes on their way to the recorder; the first ones wait until all that was stored came."""

    def __init__(self, recorder: Recorder) -> None:
        self._recorder = recorder
        self._backlog: list[Change[Any, Any]] | None = []

    async def take(self, watch: Watch) -> None:
        """Take changes for ever."""
        async for change in watch:
            if self._backlog is None:
                self._recorder.record(change)
            else:
                self._backlog.append(change)

    async def settle(self, watch: Watch) -> None:
        """Wait until all that was stored is there and nothing more comes, but not for long."""
        loop = asyncio.get_running_loop()
        give_up_at = loop.time() + BACKLOG_S
        synced = asyncio.ensure_future(watch.synced())
        try:
            had = -1
            while self._backlog is not None and loop.time() < give_up_at:
                if synced.done() and had == len(self._backlog):
                    break
                had = len(self._backlog)
                await asyncio.sleep(IDLE_S)
        finally:
            synced.cancel()
        self.settled()

    def settled(self) -> None:
        """Record what has waited, in the order in which it was written."""
        backlog, self._backlog = self._backlog, None
        if backlog:
            self._recorder.record_all(backlog)


def _show(port: int) -> subprocess.Popen[bytes] | None:
    """Open the viewer on the live stream, or say in a sentence why not."""
    url = f"rerun+http://127.0.0.1:{port}/proxy"
    if not viewer.has_screen():
        _print_line(f"there is no screen here; look on with: rerun --connect {url}")
        return None
    try:
        return viewer.start(["--port", "auto", "--connect", url])
    except NoPicture as error:
        _print_line(f"{error}; recording goes on")
        return None
