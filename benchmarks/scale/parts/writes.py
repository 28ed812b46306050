"""The key-space: confirmed writes alone and many at once, reads, watches, listings.

A real router with its store in a process of its own; Zenoh alone beside it in the same run.
"""

from __future__ import annotations

import asyncio
import tempfile
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

from benchmarks.scale.keys_run import AT_ONCE, at_once
from benchmarks.scale.parts.dispatch import percentiles_ms
from benchmarks.scale.processes import REALM, processes
from benchmarks.scale.raw_link import raw_latencies
from fleet.stores.sqlite import SqliteStore
from keyexpr_schema.facts import AT
from keyexpr_schema.keyspace import FACT
from keyexpr_schema.payloads.world import Fact, FactAddress
from keyexpr_schema.transport.session import Session, SessionConfig, open_session
from keyexpr_schema.transport.store.storage import Write

CALLS = 1500
WATCHED = 500
TOGETHER = 10_000
LISTED = 8_000
ROUNDS = 3
RAW_S = 5.0
BATCHES, BATCH = 100, 500


def measure(quick: bool) -> list[dict[str, Any]]:
    """Latencies in ms, and rates a second: the best of some rounds, and all of them."""
    fraction = 10 if quick else 1
    return [*asyncio.run(_measured(fraction)), *_store_alone(BATCHES // fraction)]


async def _measured(fraction: int) -> list[dict[str, Any]]:
    with tempfile.TemporaryDirectory() as folder:
        async with processes(Path(folder), planner=False) as fleet:
            config = SessionConfig((fleet.endpoint,), realm=REALM, component="benchmark")
            async with open_session(config) as writer, open_session(config) as reader:
                calls = CALLS // fraction
                async with raw_latencies(fleet.endpoint) as raw:
                    await asyncio.sleep(RAW_S)
                latencies = {
                    "Zenoh alone: put to subscriber": raw,
                    "put to another session's watch": await _watched(
                        writer, reader, WATCHED // fraction
                    ),
                    "get": await _repeat(lambda i: reader.get(FACT, _at(f"c{i % 100}")), calls),
                    "confirmed write": await _repeat(
                        lambda i: writer.confirm(FACT, _at(f"c{i % 100}"), _of(f"c{i % 100}", i)),
                        calls,
                    ),
                }
                rates = {
                    f"confirmed writes, {AT_ONCE} at once": [
                        await _confirmed(writer, TOGETHER // fraction) for _ in range(ROUNDS)
                    ],
                    "values in a listing": [await _listed(writer, reader, LISTED // fraction)],
                }
    return [
        *(
            {"what": what, "ms": percentiles_ms(s), "times": len(s)}
            for what, s in latencies.items()
        ),
        *({"what": what, "a_second": max(r), "rounds": r} for what, r in rates.items()),
    ]


def _at(subject: str) -> FactAddress:
    return FactAddress(subject, AT)


def _of(subject: str, value: int) -> Fact:
    return Fact(subject=subject, relation=AT, value=value, source="benchmark")


async def _repeat(call: Callable[[int], Awaitable[object]], times: int) -> list[float]:
    seconds = []
    for i in range(times):
        began_s = time.perf_counter()
        await call(i)
        seconds.append(time.perf_counter() - began_s)
    return seconds


async def _watched(writer: Session, reader: Session, times: int) -> list[float]:
    seconds = []
    async with reader.watch((FACT, {"subject": "watched"})) as watch:
        await watch.synced()
        for i in range(times):
            began_s = time.perf_counter()
            writer.put(FACT, _at("watched"), _of("watched", i))
            change = await anext(watch)
            seconds.append(time.perf_counter() - began_s)
            assert change.value is not None
            assert change.value.value == i
    return seconds


async def _confirmed(session: Session, writes: int) -> float:
    began_s = time.perf_counter()
    await at_once(
        session.confirm(FACT, _at(f"w{i % 1000}"), _of(f"w{i % 1000}", i), 60.0)
        for i in range(writes)
    )
    return writes / (time.perf_counter() - began_s)


async def _listed(writer: Session, reader: Session, count: int) -> float:
    await at_once(writer.confirm(FACT, _at(f"l{i}"), _of(f"l{i}", i), 60.0) for i in range(count))
    began_s = time.perf_counter()
    found = await reader.list(FACT, timeout_s=30.0)
    return len(found) / (time.perf_counter() - began_s)


def _store_alone(batches: int) -> list[dict[str, Any]]:
    """The store without Zenoh, by what of a power cut it outlives."""
    return [
        {"what": f"store alone, {how}, batches of {BATCH}", "a_second": max(found),
         "rounds": found}
        for how, synced in (("applied", False), ("each synced", True))
        for found in ([_applied(synced, batches) for _ in range(ROUNDS)],)
    ]  # fmt: skip


def _applied(synced: bool, batches: int) -> float:
    keys = [f"{REALM}/{FACT.build(_at(f'c{i}'))}" for i in range(BATCH)]
    with (
        tempfile.TemporaryDirectory() as folder,
        SqliteStore(Path(folder)) as store,
    ):
        began_s = time.perf_counter()
        for batch in range(batches):
            store.apply(
                [
                    Write(
                        key, (batch * BATCH + i + 1) << 128, False, "application/json", b"x" * 120
                    )
                    for i, key in enumerate(keys)
                ]
            )
            if synced:
                store.sync()
        return batches * BATCH / (time.perf_counter() - began_s)
