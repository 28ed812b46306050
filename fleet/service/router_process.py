"""The process behind `robotctl router`: a Zenoh router and the durable store of its realms."""

from __future__ import annotations

import asyncio
import signal
import sys
from contextlib import nullcontext
from pathlib import Path
from typing import Any

from fleet.errors import StoreError
from fleet.stores.sqlite import SqliteStore, StoreMemory
from keyexpr_schema.endpoints import check_endpoints
from keyexpr_schema.errors import SchemaError
from keyexpr_schema.free_ports import free_port
from keyexpr_schema.transport.receiving import spread_receiving
from keyexpr_schema.transport.router import run_router
from keyexpr_schema.transport.zenoh_file import ZenohFile

FREE_PORT = ":0"


def run(
    listen: tuple[str, ...],
    connect: tuple[str, ...],
    data_dir: Path | None,
    memory: StoreMemory | None = None,
    file: ZenohFile | None = None,
) -> None:
    """Be a router until SIGTERM or SIGINT; prints one line once it listens.

    `listen` and `connect` are Zenoh endpoints such as `tcp/127.0.0.1:7447`; port 0 takes a free
    one. `connect` names routers on other hosts. The store lies in `data_dir`; None: a router
    without a store, for the other hosts of a fleet whose store is elsewhere. `memory`: how long the
    store remembers what is over. `file` is a Zenoh configuration with all else.

    Raises:
        SystemExit: with 1 and one sentence on stderr, when it cannot start.
    """
    try:
        check_endpoints(listen, listens=True)
        endpoints = tuple(with_port(endpoint) for endpoint in listen)
        spread_receiving()
        asyncio.run(_run(endpoints, connect, data_dir, memory, file))
    except (SchemaError, StoreError, OSError) as error:
        print(f"Error: {error}", file=sys.stderr)  # noqa: T201
        raise SystemExit(1) from None


async def _run(
    listen: tuple[str, ...],
    connect: tuple[str, ...],
    data_dir: Path | None,
    memory: StoreMemory | None,
    file: ZenohFile | None,
) -> None:
    loop = asyncio.get_running_loop()
    ended = asyncio.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, ended.set)
    keeping = SqliteStore(data_dir, memory=memory) if data_dir is not None else nullcontext()
    with keeping as store:
        async with run_router(listen, connect, store, file=file) as trouble:
            print(f"router listening on {', '.join(listen)}", flush=True)  # noqa: T201
            until: tuple[asyncio.Future[Any], ...] = (
                asyncio.ensure_future(ended.wait()),
                asyncio.ensure_future(trouble()),
            )
            done, _ = await asyncio.wait(until, return_when=asyncio.FIRST_COMPLETED)
            for task in until:
                task.cancel()
            await done.pop()


def with_port(endpoint: str) -> str:
    """`endpoint` with a free TCP port in place of port 0."""
    if not endpoint.endswith(FREE_PORT):
        return endpoint
    scheme, _, address = endpoint.partition("/")
    host = address.removesuffix(FREE_PORT)
    return f"{scheme}/{host}:{free_port(host.strip('[]'))}"


if __name__ == "__main__":
    # python -m fleet.service.router_process LISTEN DATA_DIR [CONNECT...]
    run((sys.argv[1],), tuple(sys.argv[3:]), Path(sys.argv[2]))
