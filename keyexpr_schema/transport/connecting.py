"""Configuring, opening and closing Zenoh sessions, such that none is ever left open.

An unclosed Zenoh session has threads that keep the interpreter from ending.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import json
import logging
from collections.abc import AsyncIterator, Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import asynccontextmanager
from functools import partial
from typing import Any

import zenoh

from keyexpr_schema.endpoints import host_of, tcp_address
from keyexpr_schema.errors import BadEndpoint, Unreachable
from keyexpr_schema.limits import in_force
from keyexpr_schema.transport.certificate_dates import out_of_date
from keyexpr_schema.transport.closing import close_session
from keyexpr_schema.transport.link import Link
from keyexpr_schema.transport.zenoh_file import (
    Mode,
    ZenohFile,
    check_links,
    check_mode,
    check_namespace,
    said_in,
)

_log = logging.getLogger(__name__)

WAITING_LINE_S = 1.0
"""Who waits for a router for ever says so after this long."""

RESOLVE_S = 0.3
"""Who looks up a host's address for longer does not know that it has none."""

UNREAD_BYTES = 131_072
"""What the system keeps for a reader that is behind. Left to itself it comes to keep many
megabytes, and whatever is put or answered waits behind all of that. What a sender may have under
way is left as it is: that is what a reader that stands still for a moment costs nobody."""

HELD_S = 600.0
"""So long who is not a router waits for a full link [s]. It may be held because he writes too fast
(`store.held_links`); of a router that is gone the lease tells. Zenoh would wait for 5 s, and then
cut the link itself and lose what is put meanwhile."""

OPEN_ATTEMPT_MS = 500
"""Zenoh's own retry inside `open` cannot be interrupted, so it gets short attempts."""


def zenoh_config(
    mode: Mode,
    *,
    connect: Sequence[str] = (),
    listen: Sequence[str] = (),
    lease_s: float = 2.0,
    namespace: str | None = None,
    connect_timeout_ms: int | None = None,
    file: ZenohFile | None = None,
) -> zenoh.Config:
    """A Zenoh configuration: no multicast, source timestamps, no shared memory, quick retries.

    Little waits unread at a reader that is behind. A router also has a bound for messages, and for
    those who read too slowly (`limits`). What `file` says of these, of the lease and the retries
    goes before, and what it says besides is added. Shared memory is off because with it a router
    refuses sessions past 351.

    Raises:
        BadZenohConfig: `file` is for another mode, another namespace or other links.
    """
    unless_said: dict[str, Any] = {
        "scouting/multicast/enabled": False,
        "scouting/delay": 0,  # [ms] for answers to multicast: opening a router would wait them out
        "scouting/gossip/enabled": mode == "router",
        "transport/link/tx/lease": round(lease_s * 1000),
        "connect/retry": {
            "period_init_ms": 100,
            "period_max_ms": 500,
            "period_increase_factor": 2,
        },
    }
    for kind in ("tcp", "tls"):
        unless_said[f"transport/link/{kind}/so_rcvbuf"] = UNREAD_BYTES
    limits = in_force()
    # In a router all others wait for a reader that takes nothing, until it is cut off.
    waits_s = limits.slow_reader_s if mode == "router" else HELD_S
    unless_said["transport/link/tx/queue/congestion_control/block/wait_before_close"] = round(
        waits_s * 1e6
    )
    if mode == "router":
        unless_said["transport/link/rx/max_message_size"] = limits.most_in_a_message
    values: dict[str, Any] = {
        "mode": mode,
        "timestamping/enabled": True,
        "transport/shared_memory/enabled": False,
        "connect/endpoints": list(connect),
        "listen/endpoints": list(listen),
    }
    if namespace is not None:
        values["namespace"] = namespace
    if connect_timeout_ms is not None:
        values["connect/timeout_ms"] = connect_timeout_ms
    if file is not None:
        check_mode(file, mode)
        check_links(file, mode, (*connect, *listen))
        if namespace is not None:
            check_namespace(file, namespace)
    config = zenoh.Config() if file is None else file.config()
    for path, value in unless_said.items():
        if said_in(config, path) is None:
            config.insert_json5(path, json.dumps(value))
    for path, value in values.items():
        config.insert_json5(path, json.dumps(value))
    return config


async def _unknown_hosts(endpoints: Sequence[str]) -> list[str]:
    """The hosts of endpoints that have no address, as far as that is said at once."""
    loop = asyncio.get_running_loop()
    found = []
    for host in filter(None, map(host_of, endpoints)):
        try:
            await asyncio.wait_for(loop.getaddrinfo(host, None), RESOLVE_S)
        except TimeoutError:
            continue
        except OSError:
            found.append(host)
    return found


async def _listening(endpoints: Sequence[str]) -> list[str]:
    """Those over TCP at which something listens, as far as that is said at once."""
    found = []
    for endpoint in endpoints:
        if (address := tcp_address(endpoint)) is None:
            continue
        with contextlib.suppress(OSError, TimeoutError):
            async with asyncio.timeout(RESOLVE_S):
                _, writer = await asyncio.open_connection(*address)
            writer.close()
            found.append(endpoint)
    return found


def _close_unwanted(opening: Future[zenoh.Session]) -> None:
    if not opening.cancelled() and opening.exception() is None:
        close_session(opening.result())


def _heard(opening: asyncio.Future[zenoh.Session]) -> None:
    """What fails after nobody waits for it any more is told to nobody, not by asyncio either."""
    if not opening.cancelled():
        opening.exception()


async def _connect(
    endpoints: Sequence[str],
    realm: str,
    lease_s: float,
    timeout_s: float | None,
    executor: ThreadPoolExecutor,
    file: ZenohFile | None,
) -> zenoh.Session:
    loop = asyncio.get_running_loop()
    started_s = loop.time()
    pause_s = 0.1
    warned = timeout_s is not None
    # In one attempt Zenoh tries the first endpoint until its time is over, and no other.
    for attempt in itertools.count():
        first = attempt % max(1, len(endpoints))
        in_turn = (*endpoints[first:], *endpoints[:first])
        left_s = None if timeout_s is None else timeout_s - (loop.time() - started_s)
        attempt_ms = OPEN_ATTEMPT_MS if left_s is None else min(OPEN_ATTEMPT_MS, left_s * 1000)
        try:
            config = zenoh_config(
                "client",
                connect=in_turn,
                lease_s=lease_s,
                namespace=realm,
                connect_timeout_ms=max(50, round(attempt_ms)),
                file=file,
            )
        except zenoh.ZError as error:
            raise BadEndpoint(
                f"{', '.join(endpoints)} cannot be connected to: {str(error).split(' at /')[0]}"
            ) from None
        opening = executor.submit(zenoh.open, config)
        waited = asyncio.wrap_future(opening)
        waited.add_done_callback(_heard)
        try:
            return await asyncio.shield(waited)
        except zenoh.ZError as error:
            if timeout_s is not None and loop.time() - started_s + pause_s >= timeout_s:
                if listening := await _listening(endpoints):
                    raise Unreachable.not_let_in(listening, out_of_date(file)) from error
                unknown = await _unknown_hosts(endpoints)
                raise Unreachable.no_router(endpoints, unknown=unknown) from error
        except asyncio.CancelledError:
            # Nobody can interrupt it: what it opens, now or later, is closed as soon as it is open.
            opening.add_done_callback(_close_unwanted)
            raise
        if not warned and loop.time() - started_s >= WAITING_LINE_S:
            if listening := await _listening(endpoints):
                refused = Unreachable.not_let_in(listening, out_of_date(file))
                _log.warning("%s; tries again", refused)
            else:
                hosts = Unreachable.no_hosts(await _unknown_hosts(endpoints))
                where = f"at {', '.join(endpoints)}{hosts}" if endpoints else "to multicast"
                _log.warning("no router answers %s; waiting for one", where)
            warned = True
        await asyncio.sleep(pause_s)
        pause_s = min(0.5, pause_s * 2)
    raise AssertionError("unreachable: the attempts have no end")


@asynccontextmanager
async def open_link(
    endpoints: Sequence[str],
    realm: str,
    lease_s: float,
    connect_timeout_s: float | None,
    file: ZenohFile | None = None,
) -> AsyncIterator[Link]:
    """A link to the first of `endpoints` that answers; closed at the end, whatever happens.

    Raises:
        Unreachable: none answered within `connect_timeout_s`.
        BadZenohConfig: `file` is for something else.
    """
    loop = asyncio.get_running_loop()
    executor = ThreadPoolExecutor(1, "zenoh")
    try:
        session = await _connect(endpoints, realm, lease_s, connect_timeout_s, executor, file)
        close: Callable[[], None] = partial(close_session, session)
        try:
            link = Link(session, executor)
            close = link.close
            with contextlib.suppress(TimeoutError):
                await link.router.wait_up(1.0)
            yield link
        finally:
            # Shielded: an unclosed session keeps the interpreter from ending.
            await asyncio.shield(loop.run_in_executor(executor, close))
    finally:
        executor.shutdown(wait=False)
