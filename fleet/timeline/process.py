"""The recorder as a process: watches keys of a realm until a signal ends it."""

from __future__ import annotations

import asyncio
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from fleet.timeline import viewer
from fleet.timeline.drawing.sink import free_port, open_stream
from fleet.timeline.errors import NoPicture, UnwritableRecording
from fleet.timeline.recorder import RECORDED, Recorder
from fleet.timeline.rolling import Rolling, RollingFiles
from keyexpr_schema.signals import run_until_signal
from keyexpr_schema.transport.session import Change, SessionConfig, Watch, open_session

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
    files = None if rolling is None else RollingFiles(out, rolling)
    run_until_signal(_record(config, out, view, files))


async def _record(config: SessionConfig, out: Path, view: bool, files: RollingFiles | None) -> None:
    shown: subprocess.Popen[bytes] | None = None
    name = f"{config.realm} · {out.stem}"
    try:
        async with open_session(config) as session:
            port = free_port() if view else None
            first = out if files is None else files.next()
            recorder = Recorder(open_stream(first, name, port))
            if files is not None:
                files.drop_oldest()
            if port is not None:
                shown = _show(port)
            try:
                async with session.watch(*RECORDED, collect_s=COLLECT_S) as watch:
                    _print_line(f"recording to {first}")
                    await _follow(watch, recorder, view, lambda: _roll(recorder, files, name))
            finally:
                recorder.close()
    finally:
        if shown is not None:
            viewer.end(shown)


def _roll(recorder: Recorder, files: RollingFiles | None, name: str) -> None:
    """Go on in the next file if it is time; where it cannot be made, in the one there is."""
    if files is None or not files.due():
        return
    before = files.current
    path = files.next()
    try:
        stream = open_stream(path, name)
    except UnwritableRecording as error:
        _print_line(f"{error}; recording goes on in {before}")
        files.stay(before)
        return
    recorder.continue_in(stream)
    files.drop_oldest()
    _print_line(f"recording to {path}")


async def _follow(
    watch: Watch, recorder: Recorder, live: bool, flushed: Callable[[], None]
) -> None:
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
            recorder.flush(whole)
            flushed()
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
