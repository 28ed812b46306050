"""The router as a process, and what a plain Zenoh client sees of it."""

from __future__ import annotations

import asyncio
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import zenoh

from fleet.service.router_process import with_port
from fleet.stores.sqlite import SqliteStore
from keyexpr_schema.errors import CannotListen
from keyexpr_schema.keyspace import GOAL_SPEC
from keyexpr_schema.payloads.goals import Goal, GoalAddress
from keyexpr_schema.transport.connecting import zenoh_config
from keyexpr_schema.transport.router import run_router
from keyexpr_schema.transport.samples import read_stored
from keyexpr_schema.transport.session import SessionConfig, open_session
from keyexpr_schema.transport.stamps import stamp_of_text
from keyexpr_schema.transport.store.client import StoreClient
from keyexpr_schema.transport.trace import Trace
from tests.support.child_process import blocking_child
from tests.support.polling import DEADLINE_S

MODULE = "fleet.service.router_process"
KEYEXPR = "robotfleet/goals/g1/spec"


def goal(name: str) -> Goal:
    return Goal(goal=name, text="bring the cup")


def run_module(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", MODULE, *arguments],
        capture_output=True,
        text=True,
        timeout=DEADLINE_S,
    )


def test_a_port_in_use_is_one_sentence_and_status_1(router, tmp_path):
    result = run_module(router.endpoint, str(tmp_path / "other"))
    assert result.returncode == 1
    [line] = result.stderr.strip().splitlines()
    assert line.startswith(f"Error: the router cannot listen on {router.endpoint}")
    assert "is another program using the port?" in line


def test_two_routers_on_one_data_directory_are_one_sentence_and_status_1(router):
    result = run_module("tcp/127.0.0.1:0", str(router.data_dir))
    assert result.returncode == 1
    [line] = result.stderr.strip().splitlines()
    assert line.startswith(f"Error: another router uses the store in {router.data_dir}")


@pytest.mark.parametrize("endpoint", ["nonsense", "tcp/300.1.1.1:1", "tcp/127.0.0.1:99999"])
def test_an_endpoint_that_is_none_is_one_sentence(endpoint, tmp_path):
    result = run_module(endpoint, str(tmp_path / "other"))
    assert result.returncode == 1
    assert len(result.stderr.strip().splitlines()) == 1, result.stderr
    assert "is not a Zenoh endpoint: " in result.stderr
    assert "another program" not in result.stderr


def test_port_0_takes_a_free_one_and_a_signal_ends_it_cleanly(tmp_path):
    for number in (signal.SIGTERM, signal.SIGINT):
        command = (sys.executable, "-m", MODULE, "tcp/127.0.0.1:0", str(tmp_path))
        with blocking_child(*command, stderr=subprocess.PIPE) as process:
            assert process.stdout is not None
            line = process.stdout.readline()
            assert line.startswith("router listening on tcp/127.0.0.1:")
            assert int(line.rsplit(":", 1)[1]) > 0
            process.send_signal(number)
            out, err = process.communicate(timeout=DEADLINE_S)
        assert (process.returncode, out, err) == (0, "", "")


async def test_run_router_says_when_it_cannot_listen(router):
    with pytest.raises(CannotListen):
        async with run_router((router.endpoint,)):
            pass


async def test_a_plain_client_gets_value_encoding_and_timestamp(router, session_config):
    async with open_session(session_config()) as session:
        await session.confirm(GOAL_SPEC, GoalAddress("g1"), goal("g1"))
        store = StoreClient(session.link, (router.endpoint,), Trace("test"), "test")
        [stored] = await store.list(GOAL_SPEC.build(GoalAddress("g1")), DEADLINE_S)
        router.restart()
        await session.wait_connected(10)
        [again] = await store.list(GOAL_SPEC.build(GoalAddress("g1")), DEADLINE_S)
    # Exact after a restart, too, where Python cannot rebuild the timestamp.
    assert again == stored

    def get() -> zenoh.Sample:
        with zenoh.open(zenoh_config("client", connect=[router.endpoint])) as client:
            [sample] = [reply.ok for reply in client.get("robotfleet/goals/*/spec")]
            assert sample is not None
            return sample

    sample = await asyncio.to_thread(get)
    assert str(sample.key_expr) == KEYEXPR
    assert str(sample.encoding) == "application/json;robotfleet/goal_spec/1"
    assert read_stored(sample).stamp == stored.stamp
    assert 0 <= stored.stamp - stamp_of_text(str(sample.timestamp)) < 40 << 128


async def test_only_stored_keys_are_kept(router, session_config):
    foreign = zenoh_config("client", connect=[router.endpoint])
    async with open_session(session_config()) as session:
        with await asyncio.to_thread(zenoh.open, foreign) as client:
            for keyexpr in (
                "robotfleet/sim/clock",
                "robotfleet/sim/robots/r1/motion",
                "robotfleet/nobody/knows",
                "robotfleet",
                "goals/g1/spec",
                KEYEXPR,
            ):
                client.put(keyexpr, b"{}", congestion_control=zenoh.CongestionControl.BLOCK)
            await session.confirm(GOAL_SPEC, GoalAddress("g2"), goal("g2"))

            def everything() -> set[str]:
                return {str(r.ok.key_expr) for r in client.get("**") if r.ok is not None}

            async with asyncio.timeout(DEADLINE_S):
                while KEYEXPR not in (found := await asyncio.to_thread(everything)):
                    pass
    assert found == {KEYEXPR, "robotfleet/goals/g2/spec"}
    router.stop()
    with SqliteStore(router.data_dir) as store:
        assert {write.keyexpr for write in store.select("**")} == found


async def test_a_client_of_a_second_router_reaches_the_store_of_the_first(router):
    endpoint = with_port("tcp/127.0.0.1:0")
    async with (
        run_router((endpoint,), (router.endpoint,)),
        open_session(SessionConfig(endpoints=(endpoint,))) as far,
        open_session(SessionConfig(endpoints=(router.endpoint,))) as near,
        near.watch(GOAL_SPEC) as watch,
    ):
        await far.confirm(GOAL_SPEC, GoalAddress("g1"), goal("g1"))
        assert await near.get(GOAL_SPEC, GoalAddress("g1")) == goal("g1")
        assert (await asyncio.wait_for(anext(watch), DEADLINE_S)).value == goal("g1")


async def test_a_router_that_starts_before_the_one_it_names_finds_it_later(router):
    endpoint = with_port("tcp/127.0.0.1:0")
    router.kill()
    async with (
        run_router((endpoint,), (router.endpoint,)),
        open_session(SessionConfig(endpoints=(endpoint,))) as far,
    ):
        for number in range(2):  # and finds it again
            router.restart()
            await far.confirm(GOAL_SPEC, GoalAddress(f"g{number}"), goal(f"g{number}"), DEADLINE_S)
        assert len(await far.list(GOAL_SPEC)) == 2


async def test_a_list_of_two_routers_survives_the_death_of_the_first(router, tmp_path):
    second = with_port("tcp/127.0.0.1:0")
    with SqliteStore(tmp_path / "second") as store:
        async with run_router((second,), (), store):
            config = SessionConfig(endpoints=(router.endpoint, second))
            async with open_session(config) as session:
                await session.confirm(GOAL_SPEC, GoalAddress("g1"), goal("g1"))
                router.kill()
                await session.confirm(GOAL_SPEC, GoalAddress("g2"), goal("g2"), DEADLINE_S)
                assert session.connected
            assert store.select("robotfleet/goals/g2/spec")


def test_the_data_directory_is_made_where_it_is_asked_for(router: object, tmp_path: Path):
    assert (tmp_path / "router" / "state.sqlite").exists()
