"""A real Zenoh router, with the store of its realms behind it, in this process."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from contextlib import asynccontextmanager
from functools import partial

import zenoh

from keyexpr_schema.endpoints import check_endpoints
from keyexpr_schema.errors import CannotListen, SecondStore, StoreBroken
from keyexpr_schema.transport.closing import close_session
from keyexpr_schema.transport.connecting import zenoh_config
from keyexpr_schema.transport.credentials import of_router
from keyexpr_schema.transport.store.only_store import OnlyStore
from keyexpr_schema.transport.store.server import StoreServer
from keyexpr_schema.transport.store.storage import Store
from keyexpr_schema.transport.zenoh_file import ZenohFile


@asynccontextmanager
async def run_router(
    listen: Sequence[str],
    connect: Sequence[str] = (),
    store: Store | None = None,
    *,
    lease_s: float = 2.0,
    file: ZenohFile | None = None,
) -> AsyncIterator[Callable[[], Awaitable[object]]]:
    """A router on the `listen` endpoints, until the block ends; yields what waits for ever.

    That raises SecondStore or StoreBroken where a store must not be served any more.

    `connect` names other routers, which may start later; one of all should have a `store` and the
    others none, because two stores do not align after they were apart. `file` says all that is not
    given here.

    Raises:
        BadEndpoint: one is none.
        BadZenohConfig: `file` is for something else than a router, or what it names is not there.
        CannotListen: an endpoint is taken, or this machine does not have it.
    """
    check_endpoints(listen, listens=True)
    check_endpoints(connect)
    credentials = of_router(file)
    try:
        config = zenoh_config("router", listen=listen, connect=connect, lease_s=lease_s, file=file)
        config.insert_json5("listen/exit_on_failure", "true")
        # Another router that is away must not keep this one from starting; with a timeout of 0
        # it would be tried once and never again.
        config.insert_json5("connect/timeout_ms", "-1")
        config.insert_json5("connect/exit_on_failure", "false")
        session = await asyncio.shield(asyncio.to_thread(zenoh.open, config))
    except zenoh.ZError as error:
        cause = _cause(error)
        ask = ": is another program using the port?" if "in use" in cause else ""
        raise CannotListen(
            f"the router cannot listen on {', '.join(listen)} ({cause}){ask}"
        ) from None
    try:
        if store is None:
            yield asyncio.Event().wait
            return
        loop = asyncio.get_running_loop()
        broken: asyncio.Future[None] = loop.create_future()

        def on_broken(error: BaseException) -> None:
            loop.call_soon_threadsafe(_break, broken, error)

        async with OnlyStore().announced(session) as only:
            server = await asyncio.to_thread(StoreServer, session, store, credentials, on_broken)
            try:
                yield partial(_until_trouble, only, broken)
            except SecondStore:
                # Where two routers serve a key and one takes its queryable back, Zenoh 1.10 tells
                # routers that are linked later nothing of the other's. One that goes away with it
                # does no harm.
                await asyncio.shield(asyncio.to_thread(close_session, session))
                raise
            finally:
                await asyncio.shield(asyncio.to_thread(server.close))
    finally:
        await asyncio.shield(asyncio.to_thread(close_session, session))


def _break(broken: asyncio.Future[None], error: BaseException) -> None:
    if not broken.done():
        why = f"the store has met a fault of its own ({error!r}): start the router again"
        broken.set_exception(StoreBroken(why))


async def _until_trouble(only: OnlyStore, broken: asyncio.Future[None]) -> None:
    second = asyncio.ensure_future(only.second())
    try:
        done, _ = await asyncio.wait((second, broken), return_when=asyncio.FIRST_COMPLETED)
        done.pop().result()
    finally:
        second.cancel()


def _cause(error: zenoh.ZError) -> str:
    """What the system said, without where in Zenoh's code it was met."""
    said = str(error).split(" at /")[0].strip().rstrip(".!")
    return said.rpartition("[")[2]
