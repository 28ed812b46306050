"""robotctl as a person or a script would call it."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import pty
import selectors
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.support.forked_commands import COMMANDS_OF_ROBOTCTL, read_by_python
from tests.support.polling import DEADLINE_S

ENDS_S = 180.0
"""Longer than a command waits for anybody, and shorter than tests wait for a command."""


@dataclass(frozen=True)
class Finished:
    """What a run of robotctl printed and how it ended."""

    code: int
    out: str
    err: str

    @property
    def data(self) -> Any:
        return json.loads(self.out)


class Robotctl:
    """Calls robotctl, each time in a process of its own, in a folder without configuration."""

    def __init__(self, endpoint: str, folder: Path, realm: str | None = None) -> None:
        self.env = {
            **{k: v for k, v in os.environ.items() if not k.startswith("ROBOTFLEET_")},
            "ROBOTFLEET_ROUTER": endpoint,
            "HOME": str(folder),
            **({"ROBOTFLEET_REALM": realm} if realm else {}),
        }
        self.folder = folder

    def __call__(self, *arguments: str) -> Finished:
        if read_by_python(self.env) == read_by_python(os.environ):
            done = self._forked(*arguments)
        else:
            done = self._started(*arguments)
        assert "Traceback" not in done.err, done.err
        return done

    def _forked(self, *arguments: str) -> Finished:
        command = COMMANDS_OF_ROBOTCTL.start(arguments, self.env, self.folder)
        said = {command.out: b"", command.err: b""}
        hangs = False
        with selectors.DefaultSelector() as selector:
            for stream in said:
                selector.register(stream, selectors.EVENT_READ)
            while selector.get_map():
                ready = selector.select(ENDS_S)
                if not ready and not hangs:
                    hangs = True
                    os.kill(command.pid, signal.SIGABRT)  # faulthandler shows where it is
                for key, _ in ready:
                    said[key.fd] += (some := os.read(key.fd, 1 << 16))
                    if not some:
                        selector.unregister(key.fd)
        out, err = (stream.decode() for stream in said.values())
        code = command.wait()
        assert not hangs, f"{arguments} has not ended: {out}\n{err}"
        return Finished(code, out, err)

    def _started(self, *arguments: str) -> Finished:
        with subprocess.Popen(
            [sys.executable, "-X", "faulthandler", "-m", "cli.main", *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=self.env,
            cwd=self.folder,
        ) as process:
            try:
                out, err = process.communicate(timeout=ENDS_S)
            except subprocess.TimeoutExpired:
                process.send_signal(signal.SIGABRT)  # faulthandler shows where it is
                out, err = process.communicate()
                raise AssertionError(f"{arguments} has not ended: {out}\n{err}") from None
        return Finished(process.returncode, out, err)

    def at_terminal(self, typed: str, *arguments: str) -> Finished:
        """With somebody at a terminal, who types this; what it shows there is `err`."""
        ours, theirs = pty.openpty()
        shown = b""
        with subprocess.Popen(
            [sys.executable, "-m", "cli.main", *arguments],
            stdin=theirs,
            stdout=subprocess.PIPE,
            stderr=theirs,
            env=self.env,
            cwd=self.folder,
        ) as process:
            os.close(theirs)
            os.write(ours, typed.encode())
            with contextlib.suppress(OSError):  # how a terminal ends
                while some := os.read(ours, 4096):
                    shown += some
            out, _ = process.communicate(timeout=DEADLINE_S)
        os.close(ours)
        return Finished(process.returncode, out.decode(), shown.decode())

    async def soon(self, *arguments: str) -> Finished:
        return await asyncio.to_thread(self, *arguments)
