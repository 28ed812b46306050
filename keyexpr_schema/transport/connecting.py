"""Opening and closing a link, such that no session is ever left open.

An unclosed Zenoh session has threads that keep the interpreter from ending.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import threading
from collections.abc import AsyncIterator, Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager

import zenoh

from keyexpr_schema.errors import Unreachable
from keyexpr_schema.transport.link import Link
from keyexpr_schema.transport.wire import zenoh_config

_log = logging.getLogger(__name__)

WAITING_LINE_S = 1.0
"""Who waits for a router for ever says so after this long."""

OPEN_ATTEMPT_MS = 500
"""Zenoh's own retry inside `open` cannot be interrupted, so it gets short attempts."""


class _Opening:
    """`zenoh.open` on a thread, such that a session nobody waits for any more is closed."""

    def __init__(self, config: zenoh.Config) -> None:
        self._config = config
        self._lock = threading.Lock()
        self._abandoned = False
        self._session: zenoh.Session | None = None

    def run(self) -> zenoh.Session:
        session = zenoh.open(self._config)
        with self._lock:
            self._session = session
            abandoned = self._abandoned
        if abandoned:
            session.close()  # type: ignore[no-untyped-call]
        return session

    def abandon(self) -> None:
        with self._lock:
            self._abandoned = True
            session = self._session
        if session is not None:
            session.close()  # type: ignore[no-untyped-call]


async def _connect(
    endpoints: Sequence[str],
    realm: str,
    lease_s: float,
    timeout_s: float | None,
    executor: ThreadPoolExecutor,
) -> zenoh.Session:
    loop = asyncio.get_running_loop()
    started_s = loop.time()
    pause_s = 0.1
    told = timeout_s is not None
    while True:
        left_s = None if timeout_s is None else timeout_s - (loop.time() - started_s)
        attempt_ms = OPEN_ATTEMPT_MS if left_s is None else min(OPEN_ATTEMPT_MS, left_s * 1000)
        try:
            config = zenoh_config(
                "client",
                connect=endpoints,
                lease_s=lease_s,
                namespace=realm,
                connect_timeout_ms=max(50, round(attempt_ms)),
            )
        except zenoh.ZError as error:
            raise Unreachable(
                f"{', '.join(endpoints)} is not an endpoint of a router: write it like "
                "tcp/127.0.0.1:7447"
            ) from error
        opening = _Opening(config)
        try:
            return await asyncio.shield(loop.run_in_executor(executor, opening.run))
        except zenoh.ZError as error:
            if timeout_s is not None and loop.time() - started_s + pause_s >= timeout_s:
                raise Unreachable(
                    f"no router answers at {', '.join(endpoints)}: start one with "
                    "`robotctl router` or name another with --router"
                ) from error
        except asyncio.CancelledError:
            opening.abandon()
            raise
        if not told and loop.time() - started_s >= WAITING_LINE_S:
            _log.warning("no router answers at %s; waiting for one", ", ".join(endpoints))
            told = True
        await asyncio.sleep(pause_s)
        pause_s = min(0.5, pause_s * 2)


@asynccontextmanager
async def open_link(
    endpoints: Sequence[str], realm: str, lease_s: float, connect_timeout_s: float | None
) -> AsyncIterator[Link]:
    """A link to the first of `endpoints` that answers; closed at the end, whatever happens.

    Raises:
        Unreachable: none answered within `connect_timeout_s`.
    """
    loop = asyncio.get_running_loop()
    executor = ThreadPoolExecutor(1, "zenoh")
    try:
        session = await _connect(endpoints, realm, lease_s, connect_timeout_s, executor)
        close: Callable[[], None] = session.close
        try:
            link = Link(session, executor)
            close = link.close
            with contextlib.suppress(TimeoutError):
                await link.wait_up(1.0)
            yield link
        finally:
            # Shielded: an unclosed session keeps the interpreter from ending.
            await asyncio.shield(loop.run_in_executor(executor, close))
    finally:
        executor.shutdown(wait=False)
