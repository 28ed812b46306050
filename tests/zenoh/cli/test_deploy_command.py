"""Robots' workers are deployed, shown, looked at and taken away: here, and on a host over ssh."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path

from keyexpr_schema.keyspace import DEPLOYMENT, ROBOT_ALIVE, ROBOT_SPEC
from keyexpr_schema.payloads.robots import AliveAddress, RobotAddress
from keyexpr_schema.transport.session import SessionConfig, open_session
from sim.files.robot_file import load_robot
from tests.support.container_engine import container_engine
from tests.support.polling import until
from tests.support.robotctl import Robotctl
from tests.support.ssh_host import NAME, ssh_host

HSR = Path(__file__).parents[3] / "configs" / "robots" / "hsr.yaml"
MakeConfig = Callable[..., SessionConfig]
WORDS = "it's `id` $HOME; #"


def own_file(folder: Path, more: str = "") -> Path:
    """A robot's file with what a shell would make something else of."""
    file = folder / "own.yaml"
    file.write_text(
        f"{HSR.read_text()}\ndeployment:\n  environment:\n    ROBOTFLEET_ROUTER: tcp/fleet:7447\n"
        f'    WORDS: "{WORDS}"\n{more}'
    )
    return file


def check_told(told: Path) -> None:
    """That the engine was told to run a worker, and word for word what the file says."""
    text = told.read_text()
    assert "--env\nROBOTFLEET_ROUTER=tcp/fleet:7447\n" in text
    assert f"--env\nWORDS={WORDS}\n" in text
    assert text.endswith("robotfleet-worker\nworker\nhsr\n")


async def test_a_worker_is_deployed_shown_and_taken_away(
    robotctl: Robotctl, session_config: MakeConfig, tmp_path: Path
) -> None:
    container_engine(tmp_path)
    told, file = tmp_path / "told", str(own_file(tmp_path))
    robotctl.env["PATH"] = str(tmp_path)
    async with open_session(session_config(component="x")) as session:
        assert "there is no robot 'hsr'" in (await robotctl.soon("deploy", file)).err
        assert not told.exists()
        await session.confirm(ROBOT_SPEC, RobotAddress("hsr"), load_robot(file))

        deploying = asyncio.create_task(robotctl.soon("deploy", file))
        await until(told.exists, "the engine to be told something")
        async with session.token(ROBOT_ALIVE, AliveAddress("hsr", "run1")):
            done = await deploying
            assert done.code == 0, done.err
            check_told(told)
        again = await robotctl.soon("deploy", file)
        assert "hsr is deployed already, with podman on " in again.err
        (row,) = (await robotctl.soon("robots", "--json")).data
        assert (row["deployment"]["engine"], row["deployment"]["host"]) == ("podman", None)
        assert (await robotctl.soon("logs", "hsr")).out == "began\n"
        gone = await robotctl.soon("undeploy", "hsr")
        assert gone.code == 0, gone.err
        assert not (tmp_path / "robotfleet-hsr-worker.log").exists()
        assert await session.list(DEPLOYMENT) == {}

        async with session.token(ROBOT_ALIVE, AliveAddress("hsr", "run2")):
            taken = await robotctl.soon("deploy", file)
        assert "hsr has a worker already, and a second one would end" in taken.err
        own_file(tmp_path, "  image: nowhere/x\n")
        missing = await robotctl.soon("deploy", file)
        assert (missing.code, len(missing.err.splitlines())) == (1, 1)
        assert "there is no image nowhere/x on this machine" in missing.err


async def test_a_worker_is_deployed_over_ssh(
    robotctl: Robotctl, session_config: MakeConfig, tmp_path: Path
) -> None:
    there = tmp_path / "there"
    there.mkdir()
    engine, file = container_engine(there), str(own_file(tmp_path))
    there_is = ("deploy", file, "--on", "ssh", NAME, "--wait", "0")
    async with (
        ssh_host(tmp_path, str(there)) as here,
        open_session(session_config(component="x")) as session,
    ):
        robotctl.env["PATH"] = str(here)
        await session.confirm(ROBOT_SPEC, RobotAddress("hsr"), load_robot(file))
        silent = await robotctl.soon(*there_is)
        assert silent.code == 1
        assert "has not connected within 0 s: `robotctl logs hsr`" in silent.err
        check_told(there / "told")
        # Before that may stand what a shell there has to say.
        assert (await robotctl.soon("logs", "hsr")).out.splitlines()[-1] == "began"
        (there / "robotfleet-hsr-worker.log").unlink()
        gone = await robotctl.soon("undeploy", "hsr")
        assert (gone.code, await session.list(DEPLOYMENT)) == (0, {})
        assert f"was not there any more on {NAME}" in gone.err
        engine.unlink()
        none = await robotctl.soon(*there_is)
        assert f"there is no podman on {NAME}: install it there" in none.err
