"""`robotctl router` beside another router."""

from __future__ import annotations

import signal
import sys

import pytest

from tests.support.child_process import blocking_child
from tests.support.polling import DEADLINE_S
from tests.support.robotctl import Robotctl
from tests.support.router_process import RouterProcess

FREE = "tcp/127.0.0.1:0"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--listen", "localhost"], "--listen: 'localhost' is not a Zenoh endpoint"),
        (["--listen", FREE, "--connect", "host", "--no-store"], "--connect: 'host' is not a Zenoh"),
        (["--connect", "tcp/127.0.0.1:1", "--data", "x"], "linked with others keeps none: leave"),
        (["--no-store", "--data", "x"], "--no-store: leave out --data"),
        (["--no-store", "--tombstones", "0"], "--no-store: leave out --data"),
        (["--zenoh-config", "nowhere.json5"], "there is no file nowhere.json5"),
    ],
)
def test_what_a_router_cannot_be_is_one_sentence(
    robotctl: Robotctl, arguments: list[str], words: str
) -> None:
    said = robotctl("router", *arguments)
    assert said.code == 1
    assert said.out == ""
    assert said.err.startswith("Error: ")
    assert words in said.err
    assert said.err.count("\n") == 1


async def test_a_second_router_without_a_store_shows_what_the_first_one_keeps(
    robotctl: Robotctl, router: RouterProcess
) -> None:
    """What was stored before it started, too; and what is said through it is kept by the first.
    Without that nobody knows what is there, which is not the same as nothing. One that wanted a
    store of its own was refused before, and leaves no trace."""
    said = robotctl(
        *("router", "--listen", FREE, "--connect", robotctl.env["ROBOTFLEET_ROUTER"]),
        *("--store", "--data", str(robotctl.folder / "second")),
    )
    assert said.code == 1
    assert said.err.startswith("Error: another router that this one is linked with has a store")
    assert said.err.endswith("start this router with --no-store\n")
    await robotctl.soon("world", "add", "--place", "attic")
    command = [sys.executable, "-m", "cli.main", "router", "--listen", FREE]
    command += ["--connect", robotctl.env["ROBOTFLEET_ROUTER"]]
    with blocking_child(*command, env=robotctl.env, cwd=robotctl.folder) as second:
        assert second.stdout is not None
        endpoint = second.stdout.readline().split()[-1]
        there = Robotctl(endpoint, robotctl.folder)
        said = await there.soon("world", "add", "--place", "cellar")
        assert said.code == 0, said.err
        for each in (there, robotctl):
            listed = (await each.soon("world", "list")).out
            assert "attic" in listed
            assert "cellar" in listed
        assert not (robotctl.folder / ".local").exists()
        router.kill()
        for words in (("goal", "list"), ("goal", "delete", "g1")):
            said = await there.soon(*words)
            assert (said.code, said.out) == (1, "")
            assert said.err.startswith(f"Error: a router answers at {endpoint}, but no store")
        second.send_signal(signal.SIGINT)
        second.communicate(timeout=DEADLINE_S)
