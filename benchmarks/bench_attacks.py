"""What a fleet feels of a client that puts far too much, side by side with a fleet without one.

Each time the two-cups mission runs (kinematic, every process its own) while somebody else's client
attacks; its own start, which takes the processors of this host, is over before. Measured: how long
the mission took, and what a bystander waited for confirmed writes of one key and for the planner's
answer to a question, over that time; then how long the planner takes to be ready when it starts
again.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from cli.demo.mission_run import Demo, DemoOptions, running_demo
from cli.processes.composition import PLANNER
from keyexpr_schema.errors import NoReply, SchemaError, Unconfirmed, Unreachable
from keyexpr_schema.keyspace import FACT, HISTORY_STATS, PLANNER_ALIVE
from keyexpr_schema.payloads.history import HistoryStatsQuery
from keyexpr_schema.payloads.system import PlannerAddress
from keyexpr_schema.payloads.world import Fact, FactAddress

FOREIGN = """
import sys, time, json, zenoh
config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", json.dumps([sys.argv[1]]))
config.insert_json5("namespace", json.dumps(sys.argv[2]))
config.insert_json5("timestamping/enabled", "true")
config.insert_json5(
    "transport/link/tx/queue/congestion_control/block/wait_before_close", "600000000"
)  # by itself Zenoh gives up after 5 s
session = zenoh.open(config)
block = zenoh.CongestionControl.BLOCK
def put(key, data): session.put(key, data, congestion_control=block)
def fact(n, value): put(f"world/facts/thing{n}/at", json.dumps(value))
def goal(name, text): put(f"goals/{name}/spec", json.dumps({"goal": name, "text": text}))
print("ready", flush=True)
sys.stdin.readline()
"""
FACTS_OF_NOTHING = (
    "for n in range(60_000): fact(n, {'subject': f'thing{n}', 'relation': 'at', "
    "'value': 'kitchen', 'source': 'person'})"
)
ATTACKS = {
    "none": "",
    "3 goals of 100 MB": "for n in range(3): goal(f'big{n}', 'x' * 100_000_000)",
    "30,000 goals": "for n in range(30_000): goal(f'much{n}', 'Bring cup 1 to the kitchen')",
    "60,000 facts that are none": "for n in range(60_000): fact(n, {'subject': 3})",
    "60,000 facts of nothing": FACTS_OF_NOTHING,
    "4 clients, 60,000 facts of nothing each": FACTS_OF_NOTHING,
    "20 clients, 60,000 facts of nothing each": FACTS_OF_NOTHING,
    "a stopped reader of **": "session.declare_subscriber('**', lambda sample: None)",
    "a stopped reader of **, and 3 MB for it": (
        "session.declare_subscriber('**', lambda sample: None)"
    ),
}
"""What the attacker runs, by what it is called."""
TALK = """
for n in range(3_000):
    fact(n % 100, {'subject': f'thing{n % 100}', 'relation': 'at', 'value': 'x' * 1_000,
                   'source': 'person'})
    time.sleep(0.001)
"""
"""What a second client puts, so that what lies ready for the stopped one fills its connection."""


def _client(demo: Demo, what: str) -> subprocess.Popen[bytes]:
    """A client that waits for `_begin`."""
    program = f"{FOREIGN}\n{what}\nprint('done', flush=True)\ntime.sleep(3600)"
    processes = demo.processes
    return subprocess.Popen(
        [sys.executable, "-c", program, processes.endpoint, processes.realm],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )


async def _said(client: subprocess.Popen[bytes]) -> None:
    """The next line that a client says."""
    assert client.stdout is not None
    await asyncio.to_thread(client.stdout.readline)


async def _begin(clients: Sequence[subprocess.Popen[bytes]]) -> None:
    """Have clients attack, once all are connected."""
    for client in clients:
        await _said(client)
    for client in clients:
        assert client.stdin is not None
        client.stdin.write(b"\n")
        client.stdin.flush()


MORE_S = 20.0
"""For so long after the mission, at most, the attack goes on [s]."""


class Bystander:
    """Writes and asks all the time, and notes how long it waits [s]."""

    def __init__(self, demo: Demo) -> None:
        self._session = demo.session
        self.writes: list[float] = []
        self.answers: list[float] = []
        self.failures = 0

    async def write(self) -> None:
        """Confirm one key again and again."""
        number = 0
        while True:
            number += 1
            fact = Fact(subject="bystander", relation="said", value=number, source="bystander")
            begun_s = time.perf_counter()
            try:
                await self._session.confirm(FACT, FactAddress.of(fact.key), fact, 60.0)
            except SchemaError:
                self.failures += 1
            self.writes.append(time.perf_counter() - begun_s)
            await asyncio.sleep(0.02)

    async def ask(self) -> None:
        """Ask the planner for what it keeps again and again."""
        while True:
            begun_s = time.perf_counter()
            try:
                await self._session.query(
                    HISTORY_STATS, PlannerAddress(), HistoryStatsQuery(), timeout_s=60.0
                )
            except NoReply:
                self.failures += 1
            self.answers.append(time.perf_counter() - begun_s)
            await asyncio.sleep(0.05)


async def measure(attack: str, out: Path) -> dict[str, float | str | int]:
    """The mission with one attack."""
    options = DemoOptions("two-cups", out, backend="kinematic", apart=True, timeout_s=600.0)
    async with running_demo(options) as demo:
        bystander = Bystander(demo)
        watching = [asyncio.create_task(each) for each in (bystander.write(), bystander.ask())]
        many = int(attack.split()[0]) if "clients" in attack else 1
        clients = [_client(demo, ATTACKS[attack]) for _ in range(many)]
        attacker = clients[0]
        try:
            await _begin(clients)
            if "stopped" in attack:
                await _said(attacker)
                os.kill(attacker.pid, signal.SIGSTOP)
                if "3 MB" in attack:
                    clients.append(_client(demo, TALK))
                    await _begin(clients[1:])
            begun_s = time.perf_counter()
            await demo.processes.guard(submitted(demo))
            await demo.processes.guard(demo.wait_until_ended())
            took_s = time.perf_counter() - begun_s
            summary = await demo.verify()
            last = clients[-1]
            if attack != "none" and ("stopped" not in attack or last is not attacker):
                await _all_put(last, demo)
            after_s = time.perf_counter() - begun_s
        finally:
            for client in clients:
                client.kill()
                client.wait()
            for task in watching:
                task.cancel()
            await asyncio.gather(*watching, return_exceptions=True)
        start_s = await demo.processes.guard(_started_again(demo))
        return {
            "attack": attack,
            "reached": "yes" if summary.ok else "no",
            "mission_s": took_s,
            "attack_s": after_s,
            "write_p50_ms": 1e3 * _quantile(bystander.writes, 0.5),
            "write_max_ms": 1e3 * max(bystander.writes, default=0.0),
            "answer_p50_ms": 1e3 * _quantile(bystander.answers, 0.5),
            "answer_max_ms": 1e3 * max(bystander.answers, default=0.0),
            "failures": bystander.failures,
            "start_s": start_s,
        }


async def _all_put(client: subprocess.Popen[bytes], demo: Demo) -> None:
    """Wait until a client has put all, or for a while: who is slowed down would need minutes."""
    reading = asyncio.create_task(_said(client))
    await demo.processes.guard(asyncio.wait([reading], timeout=MORE_S))
    client.kill()
    await reading


async def submitted(demo: Demo) -> None:
    """Say what is wanted; a store that is late with an answer is asked again."""
    while True:
        try:
            await demo.submit()
        except (Unreachable, Unconfirmed, NoReply):
            continue
        return


async def _started_again(demo: Demo) -> float:
    await demo.processes.kill(PLANNER)
    begun_s = time.perf_counter()
    await demo.processes.start(PLANNER)
    async with demo.session.watch_tokens(PLANNER_ALIVE, 0.0) as tokens:
        async for change in tokens:
            if change.alive:
                break
    while True:
        with contextlib.suppress(NoReply):
            await demo.session.query(HISTORY_STATS, PlannerAddress(), HistoryStatsQuery(), 60.0)
            return time.perf_counter() - begun_s


def _quantile(values: list[float], share: float) -> float:
    return sorted(values)[int(share * (len(values) - 1))] if values else 0.0


def main() -> None:
    """Measure each attack, and print a table."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--only", help="the attack of this name, or all that have it in theirs")
    given = options.parse_args()
    print("| attack | reached | mission [s] | confirmed write p50, max [ms] |", end="")
    print(" answer p50, max [ms] | not answered | next start [s] |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    wanted = [given.only] if given.only in ATTACKS else ATTACKS
    for attack in wanted:
        if given.only and given.only not in attack:
            continue
        with tempfile.TemporaryDirectory() as folder:
            row = asyncio.run(measure(attack, Path(folder) / "run"))
        print(
            f"| {attack} | {row['reached']} | {row['mission_s']:.1f} "
            f"| {row['write_p50_ms']:.1f}, {row['write_max_ms']:.0f} "
            f"| {row['answer_p50_ms']:.1f}, {row['answer_max_ms']:.0f} "
            f"| {row['failures']} | {row['start_s']:.1f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
