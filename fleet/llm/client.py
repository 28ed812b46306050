"""Asks language models, each call in a process that is ended when its time is over."""

from __future__ import annotations

import contextlib
import os
import selectors
import subprocess
import sys
import threading
import time
import weakref
from typing import Any

import msgspec

from keyexpr_schema.decoding import decode

START_TIMEOUT_S = 120.0
"""For the process to import LiteLLM, which takes 5 s on two idle cores."""
GRACE_S = 1.0
"""What a call may take longer than its own timeout before its process is ended."""
MAX_ANSWER_CHARS = 200_000
MAX_LINE_BYTES = 8 * MAX_ANSWER_CHARS


class ModelAnswer(msgspec.Struct, frozen=True, kw_only=True):
    """What came of one call: text, or an `error` of a `kind`.

    Kinds: `answer`; `timeout`, `rate-limit`, `unavailable`; `key`, `unknown-model`, `form` (the
    server did not take the request), `too-long`, `refused`, `oversized`, `closed`, `failed`.
    `usd` is the price by LiteLLM's table, or `None` if the model is not in it.
    """

    kind: str
    text: str = ""
    finish: str = "stop"
    refusal: str | None = None
    error: str = ""
    tokens_in: int = 0
    tokens_out: int = 0
    usd: float | None = None
    retry_after_s: float | None = None


_CLOSED = ModelAnswer(kind="closed", error="the planner is being closed")
_ENDED = ModelAnswer(kind="failed", error="the process that asks the model has ended")


class ModelClient:
    """Carries out calls, from any thread. Processes are kept for later calls until `close`."""

    def __init__(self) -> None:
        self._idle: list[_LiteLlmProcess] = []
        self._all: set[_LiteLlmProcess] = set()
        self._lock = threading.Lock()
        self._warming = threading.Lock()
        self._awaiting = threading.Lock()
        """Held by the one call that is for the process which `warm` starts."""
        self._closed = False
        # Also ends the processes if nobody calls `close` before the interpreter ends.
        self._finalizer = weakref.finalize(self, _end_all, self._all)

    def call(self, request: dict[str, Any], timeout_s: float) -> ModelAnswer:
        """The answer to one request: LiteLLM's `completion` arguments and `api_key_env`."""
        if self._warming.locked() and self._awaiting.acquire(blocking=False):
            try:
                with self._warming:  # two that start at the same time take twice as long
                    pass
            finally:
                self._awaiting.release()
        process = self._take()
        if process is None:
            return _CLOSED
        failed = process.start()
        row = {**request, "timeout": timeout_s, "max_chars": MAX_ANSWER_CHARS}
        answer = failed or process.ask(row, timeout_s + GRACE_S)
        self._give_back(process)
        return answer

    def warm(self) -> None:
        """Start a process now, so that the first call need not wait for it. Blocks until then."""
        with self._warming:
            if (process := self._take()) is not None:
                process.start()
                self._give_back(process)

    def close(self) -> None:
        """End all processes; a call that is under way fails at once, and so does any later one."""
        with self._lock:
            self._closed = True
            idle, self._idle = self._idle, []
            busy = self._all.difference(idle)
        for process in idle:
            self._drop(process)
        for process in busy:
            # The thread that waits for it sees its end, and drops it.
            process.end()

    def _take(self) -> _LiteLlmProcess | None:
        with self._lock:
            if self._closed:
                return None
            if self._idle:
                return self._idle.pop()
            process = _LiteLlmProcess()
            self._all.add(process)
            return process

    def _give_back(self, process: _LiteLlmProcess) -> None:
        with self._lock:
            if process.running and not self._closed:
                self._idle.append(process)
                return
        self._drop(process)

    def _drop(self, process: _LiteLlmProcess) -> None:
        process.end()
        process.release()
        with self._lock:
            self._all.discard(process)


class _LiteLlmProcess:
    """One process, used by one thread at a time; any thread may `end` it."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._read = b""
        self._lock = threading.Lock()
        self._ended = False

    @property
    def running(self) -> bool:
        return self._process is not None and not self._ended and self._process.poll() is None

    def start(self) -> ModelAnswer | None:
        """Start the process if it does not run; why it does not start, or `None`."""
        with self._lock:
            if self._ended:
                return _CLOSED
            if self.running:
                return None
            self.release()
            self._read = b""
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "fleet.llm.litellm_process"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
            )
        ready = self._line(START_TIMEOUT_S)
        if ready.kind == "ready":
            return None
        self._stop()
        if ready.kind == "timeout" and not ready.error:
            error = f"the process that asks it was not ready within {START_TIMEOUT_S:g} s"
            return ModelAnswer(kind="timeout", error=error)
        return ready

    def ask(self, request: dict[str, Any], timeout_s: float) -> ModelAnswer:
        process = self._process
        assert process is not None and process.stdin is not None
        try:
            process.stdin.write(msgspec.json.encode(request) + b"\n")
            process.stdin.flush()
        except (OSError, ValueError):
            self._stop()
            return _ENDED
        answer = self._line(timeout_s)
        if answer.kind == "timeout" and not answer.error:
            error = f"no whole answer within {timeout_s - GRACE_S:g} s"
            return ModelAnswer(kind="timeout", error=error)
        return answer

    def _line(self, timeout_s: float) -> ModelAnswer:
        """The next line from the process; whatever is wrong with it ends the process."""
        process = self._process
        assert process is not None and process.stdout is not None
        deadline = time.monotonic() + timeout_s
        with selectors.DefaultSelector() as selector:
            selector.register(process.stdout, selectors.EVENT_READ)
            while b"\n" not in self._read:
                left = deadline - time.monotonic()
                if left <= 0 or not selector.select(left):
                    self._stop()
                    return ModelAnswer(kind="timeout")
                some = os.read(process.stdout.fileno(), 1 << 16)
                if not some or len(self._read) > MAX_LINE_BYTES:
                    self._stop()
                    return _ENDED
                self._read += some
        line, _, self._read = self._read.partition(b"\n")
        try:
            return decode(line, ModelAnswer)
        except msgspec.MsgspecError as error:
            self._stop()
            return ModelAnswer(kind="failed", error=f"the answer cannot be passed on: {error}")

    def _stop(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait()

    def release(self) -> None:
        """Reap the process and close its pipes."""
        process, self._process = self._process, None
        if process is None:
            return
        process.kill()
        process.wait()
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                with contextlib.suppress(OSError):
                    pipe.close()

    def end(self) -> None:
        """End it for good; a thread that waits for its answer sees that at once."""
        with self._lock:
            self._ended = True
            self._stop()


def _end_all(processes: set[_LiteLlmProcess]) -> None:
    for process in tuple(processes):
        process.end()
        process.release()
