"""A router with its store, in a process of its own."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from contextlib import AbstractContextManager
from pathlib import Path

from fleet.service.router_process import with_port
from tests.support.child_process import end_child
from tests.support.polling import DEADLINE_S
from tests.support.process_ids import frozen


class RouterProcess:
    """A router on a free port; `kill` is `kill -9`, `restart` keeps port and data."""

    def __init__(self, data_dir: Path) -> None:
        self.data_dir = data_dir
        self.endpoint = with_port("tcp/127.0.0.1:0")
        self._process: subprocess.Popen[str] | None = None
        self.start()

    def start(self) -> None:
        """Start, and return once it listens."""
        process = subprocess.Popen(
            [
                sys.executable,
                "-m",
                "fleet.service.router_process",
                self.endpoint,
                str(self.data_dir),
            ],
            stdout=subprocess.PIPE,
            text=True,
        )
        self._process = process
        assert process.stdout is not None
        line = process.stdout.readline()
        if line.strip() != f"router listening on {self.endpoint}":
            self._end(signal.SIGKILL)
            raise RuntimeError(f"the router did not start: {line!r}")

    @property
    def pid(self) -> int:
        assert self._process is not None
        return self._process.pid

    def kill(self) -> None:
        """End it without a chance to tidy up."""
        self._end(signal.SIGKILL)

    def stop(self) -> int | None:
        """Ask it to end; its exit status."""
        return self._end(signal.SIGTERM)

    def restart(self) -> None:
        """Start it again on the same port and data, ending it first if it still runs."""
        self.kill()
        self.start()

    def frozen(self) -> AbstractContextManager[None]:
        """In the block it does nothing."""
        return frozen(self.pid)

    def freeze(self) -> None:
        """Stop it from running, as a lost network would."""
        os.kill(self.pid, signal.SIGSTOP)

    def thaw(self) -> None:
        """Let a frozen one go on."""
        os.kill(self.pid, signal.SIGCONT)

    def _end(self, number: signal.Signals) -> int | None:
        process, self._process = self._process, None
        if process is None:
            return None
        process.send_signal(number)
        try:
            return process.wait(DEADLINE_S)
        finally:
            end_child(process)
