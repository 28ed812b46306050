"""How fast the key-space is: confirmed writes, reads, watches, applied puts.

Run from anywhere: `python benchmarks/bench_keyspace.py` (or `make bench`). A real router with its
store in a process of its own, on the loopback; wall times of this machine.
"""

from __future__ import annotations

import asyncio
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import zenoh
from rich.console import Console
from rich.table import Table
from zenoh import handlers

from fleet.service.router_process import with_port
from fleet.stores.sqlite import SqliteStore
from keyexpr_schema.facts import AT
from keyexpr_schema.keyspace import FACT, STORE_JOURNAL
from keyexpr_schema.payloads.system import StoreAddress, StoreQuery
from keyexpr_schema.payloads.world import Fact, FactAddress
from keyexpr_schema.transport.connecting import zenoh_config
from keyexpr_schema.transport.session import Session, SessionConfig, open_session
from keyexpr_schema.transport.store.storage import Write

CALLS = 1500
WATCHED = 500
AT_ONCE = (1, 8, 64, 256)
WRITES = 10_000
PUTS = 20_000
LISTED = 10_000
BATCHES, BATCH = 100, 500


def main() -> None:
    """Print the tables."""
    console = Console(width=140)
    with tempfile.TemporaryDirectory() as folder, _router(Path(folder) / "data") as endpoint:
        latencies, rates = asyncio.run(_measured(endpoint))
    rates.extend(_store_alone())
    console.print(f"machine load: {', '.join(f'{each:.1f}' for each in os.getloadavg())}")
    console.print(latencies_table(latencies))
    table = Table("what", "a second", title="throughput")
    for what, rate in rates:
        table.add_row(what, f"{rate:,.0f}")
    console.print(table)


def latencies_table(latencies: list[tuple[str, list[float]]]) -> Table:
    """Percentiles of lists of seconds."""
    table = Table("what", "times", "p50", "p99", "worst", title="latency, one after the other")
    for what, seconds in latencies:
        ordered = sorted(seconds)
        marks = (ordered[len(ordered) // 2], ordered[int(len(ordered) * 0.99)], ordered[-1])
        table.add_row(what, str(len(ordered)), *(f"{mark * 1e3:.2f} ms" for mark in marks))
    return table


@contextmanager
def _router(data: Path) -> Iterator[str]:
    """A router on a free port; its endpoint."""
    endpoint = with_port("tcp/127.0.0.1:0")
    command = [sys.executable, "-m", "fleet.service.router_process", endpoint, str(data)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        if not process.stdout.readline().startswith("router listening"):
            raise SystemExit("the router did not start")
        yield endpoint
    finally:
        process.terminate()
        process.wait(10)


def _fact(value: int) -> Fact:
    return Fact(subject="cup", relation=AT, value=value, source="benchmark")


async def _measured(
    endpoint: str,
) -> tuple[list[tuple[str, list[float]]], list[tuple[str, float]]]:
    config = SessionConfig((endpoint,))
    async with open_session(config) as writer, open_session(config) as reader:
        latencies = [
            ("raw put to subscriber, through the router", await _raw(endpoint)),
            ("confirm: put, and the store's word for it", await _repeat(_confirm(writer), CALLS)),
            ("create: compare and set", await _repeat(_create(writer), CALLS)),
            ("get", await _repeat(lambda i: reader.get(FACT, _at(f"c{i % 100}")), CALLS)),
            ("watch: from put to the other session's watcher", await _watched(writer, reader)),
        ]
        rates = [
            *[
                (f"confirmed writes of new keys, {at_once} at once", rate)
                for at_once in AT_ONCE
                for rate in [await _confirmed_together(writer, at_once)]
            ],
            *await _puts(writer),
            (f"values in a listing of {LISTED:,}", await _listed(writer, reader)),
        ]
    return latencies, rates


def _at(subject: str) -> FactAddress:
    return FactAddress(subject, AT)


def _confirm(session: Session) -> Callable[[int], Awaitable[object]]:
    return lambda i: session.confirm(FACT, _at(f"c{i % 100}"), _fact(i))


def _create(session: Session) -> Callable[[int], Awaitable[object]]:
    return lambda i: session.create(FACT, _at(f"n{i}"), _fact(i))


async def _raw(endpoint: str) -> list[float]:
    """What Zenoh itself takes, of the same size, with nothing of ours around it."""
    config = {"connect": [endpoint], "namespace": "raw"}
    data = FACT.encode(_fact(0))
    seconds: list[float] = []
    with (
        await asyncio.to_thread(zenoh.open, zenoh_config("client", **config)) as sender,  # type: ignore[arg-type]
        await asyncio.to_thread(zenoh.open, zenoh_config("client", **config)) as receiver,  # type: ignore[arg-type]
    ):
        subscriber = receiver.declare_subscriber("unstored", handlers.FifoChannel(10))
        await asyncio.sleep(0.5)  # until the router knows the subscriber
        for _ in range(CALLS):
            began_s = time.perf_counter()
            sender.put("unstored", data)
            subscriber.recv()
            seconds.append(time.perf_counter() - began_s)
    return seconds


async def _repeat(call: Callable[[int], Awaitable[object]], times: int) -> list[float]:
    seconds = []
    for i in range(times):
        began_s = time.perf_counter()
        await call(i)
        seconds.append(time.perf_counter() - began_s)
    return seconds


async def _watched(writer: Session, reader: Session) -> list[float]:
    seconds = []
    async with reader.watch((FACT, {"subject": "watched"})) as watch:
        await watch.synced()
        for i in range(WATCHED):
            began_s = time.perf_counter()
            writer.put(FACT, _at("watched"), _fact(i))
            change = await anext(watch)
            seconds.append(time.perf_counter() - began_s)
            assert change.value is not None
            assert change.value.value == i
    return seconds


async def _confirmed_together(session: Session, at_once: int) -> float:
    each = min(WRITES // at_once, 2000)

    async def write(number: int) -> None:
        for i in range(each):
            await session.confirm(FACT, _at(f"w{at_once}-{number}-{i}"), _fact(i))

    began_s = time.perf_counter()
    await asyncio.gather(*(write(number) for number in range(at_once)))
    return at_once * each / (time.perf_counter() - began_s)


async def _puts(session: Session) -> list[tuple[str, float]]:
    """Puts handed over, and puts applied by the store, a second."""
    before = await _journaled(session)
    began_s = time.perf_counter()
    for i in range(PUTS):
        session.put(FACT, _at(f"p{i % 1000}"), _fact(i))
    handed_over_s = time.perf_counter() - began_s
    await session.confirm(FACT, _at("last"), _fact(0), timeout_s=60.0)
    while await _journaled(session) < before + PUTS + 1:
        pass
    applied_s = time.perf_counter() - began_s
    return [
        ("puts handed to Zenoh by one session", PUTS / handed_over_s),
        ("puts applied and journaled by the store", PUTS / applied_s),
    ]


async def _journaled(session: Session) -> int:
    reply = await session.query(STORE_JOURNAL, StoreAddress(), StoreQuery(limit=0))
    return int(reply.last)


async def _listed(writer: Session, reader: Session) -> float:
    for i in range(LISTED):
        writer.put(FACT, _at(f"l{i}"), _fact(i))
    await writer.confirm(FACT, _at("last"), _fact(1), timeout_s=60.0)
    began_s = time.perf_counter()
    found = await reader.list(FACT, timeout_s=30.0)
    return len(found) / (time.perf_counter() - began_s)


def _store_alone() -> list[tuple[str, float]]:
    rates = []
    for synchronous in ("NORMAL", "FULL"):
        with (
            tempfile.TemporaryDirectory() as folder,
            SqliteStore(Path(folder), synchronous=synchronous) as store,
        ):
            began_s = time.perf_counter()
            for batch in range(BATCHES):
                store.apply(
                    [
                        Write(
                            f"realm/{FACT.build(_at(f'c{i}'))}",
                            (batch * BATCH + i + 1) << 128,
                            False,
                            "application/json",
                            b"x" * 120,
                        )
                        for i in range(BATCH)
                    ]
                )
            took_s = time.perf_counter() - began_s
            rates.append(
                (f"store alone, {synchronous}, batches of {BATCH}", BATCHES * BATCH / took_s)
            )
    return rates


if __name__ == "__main__":
    main()
