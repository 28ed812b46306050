"""Runs of robotctl, each a process of its own, forked from one that has imported it already.

Run as a script it is that process. It holds no thread and no session, so what is forked from it is
as new as what Python starts, and comes about for a quarter of the computing time.
"""

from __future__ import annotations

import atexit
import faulthandler
import gc
import importlib
import io
import json
import os
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TextIO

MAX_REQUEST = 1 << 18
OF_PYTHON = ("PYTHON", "LANG", "LC_")
"""What Python reads from the environment before it runs anything."""


def read_by_python(env: Mapping[str, str]) -> dict[str, str]:
    """The part of an environment that a process which runs already does not read again."""
    return {name: value for name, value in env.items() if name.startswith(OF_PYTHON)}


class ForkedCommand:
    """A command that runs; what it prints comes from `out` and `err`."""

    def __init__(self, out: int, err: int, status: socket.socket) -> None:
        self.out, self.err, self._status = out, err, status
        self.pid = int(status.recv(64))

    def wait(self) -> int:
        """Its exit status, once it has ended, as `subprocess` gives it; closes everything."""
        try:
            return os.waitstatus_to_exitcode(int(self._status.recv(64)))
        finally:
            self._status.close()
            os.close(self.out)
            os.close(self.err)


class CommandServer:
    """The process that commands are forked from; started with the first, ends with this one."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._requests: socket.socket | None = None

    def start(self, arguments: tuple[str, ...], env: Mapping[str, str], cwd: Path) -> ForkedCommand:
        request = json.dumps({"arguments": arguments, "env": dict(env), "cwd": str(cwd)}).encode()
        assert len(request) < MAX_REQUEST
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        (out, out_end), (err, err_end) = os.pipe(), os.pipe()
        with theirs, self._lock:
            if self._requests is None:
                self._requests = self._started()
            socket.send_fds(self._requests, [request], [0, out_end, err_end, theirs.fileno()])
        os.close(out_end)
        os.close(err_end)
        return ForkedCommand(out, err, ours)

    def _started(self) -> socket.socket:
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 2 * MAX_REQUEST)
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-X", "faulthandler", __file__, str(theirs.fileno())],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                pass_fds=[theirs.fileno()],
            )
        atexit.register(self._end)
        return ours

    def _end(self) -> None:
        if self._requests is not None and self._process is not None:
            self._requests.close()
            self._process.wait()


COMMANDS_OF_ROBOTCTL = CommandServer()


def _serve(requests: socket.socket) -> None:
    """Fork for every request; returns in each of the forked processes, and ends this one when
    nobody can ask any more."""
    while True:
        data, fds, _, _ = socket.recv_fds(requests, MAX_REQUEST, 4)
        if not data:
            sys.exit()
        if os.fork() == 0:
            requests.close()
            _become(json.loads(data), fds)
            return
        for fd in fds:
            os.close(fd)
        while _reaped():
            pass


def _reaped() -> bool:
    try:
        return os.waitpid(-1, os.WNOHANG)[0] != 0
    except ChildProcessError:
        return False


def _become(request: dict[str, Any], fds: list[int]) -> None:
    """Tells of the command's process and its end; returns in it."""
    *streams, status = fds
    pid = os.fork()
    if pid:
        for fd in streams:
            os.close(fd)
        with socket.socket(fileno=status) as told:
            told.send(str(pid).encode())
            _, how = os.waitpid(pid, 0)
            told.send(str(how).encode())
        signal.raise_signal(signal.SIGKILL)  # nothing of what it was forked from is its to tidy up
    os.close(status)
    for number, fd in enumerate(streams):
        os.dup2(fd, number)
        os.close(fd)
    # Those that there are know whether one can seek in what they were opened on.
    sys.stdin = _stream(0, "r", sys.stdin)
    sys.stdout = _stream(1, "w", sys.stdout)
    sys.stderr = _stream(2, "w", sys.stderr, line_buffering=True)
    os.environ.clear()
    os.environ.update(request["env"])
    os.chdir(request["cwd"])
    sys.path[0] = request["cwd"]  # as `python -m` has it
    sys.argv[1:] = request["arguments"]


def _stream(fd: int, mode: str, like: TextIO, line_buffering: bool = False) -> TextIO:
    raw = open(fd, f"{mode}b", closefd=False)  # noqa: SIM115
    return io.TextIOWrapper(raw, like.encoding, like.errors, line_buffering=line_buffering)


if __name__ == "__main__":
    from cli.main import COMMANDS, main

    for module, _ in (target.split(":") for target, _ in COMMANDS.values()):
        importlib.import_module(module)
    for module in ("rich.table", "zenoh", "keyexpr_schema.transport.session"):
        importlib.import_module(module)
    gc.freeze()  # what is looked through for garbage is copied
    _serve(socket.socket(fileno=int(sys.argv[1])))
    faulthandler.enable()
    main()
