"""The shipped layouts of routers carry the two cups, between hosts that are really apart."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from tests.support.hosts import Host, hosts, why_not
from tests.support.polling import until

pytestmark = [
    pytest.mark.e2e,
    pytest.mark.slow,
    pytest.mark.skipif(why_not() is not None, reason=f"no hosts can be made here: {why_not()}"),
]

ROUTERS = Path(__file__).parents[2] / "configs" / "routers"
MISSION = ("two-cups", "--backend", "kinematic")
ENDS_S = "200"
"""What goals may take: less than the tests wait for a command."""


def configured(host: Host, name: str, **addresses: str) -> Host:
    """The host with a copy of a shipped configuration, in which names became addresses."""
    text = (ROUTERS / name).read_text()
    for other, address in addresses.items():
        assert f"tcp/{other}:7447" in text
        text = text.replace(f"tcp/{other}:7447", f"tcp/{address}:7447")
    host.configuration = host.folder / Path(name).name
    host.configuration.write_text(text)
    return host


def said(host: Host, *arguments: str) -> str:
    done = host.robotctl(*arguments)
    assert done.returncode == 0, (arguments, done.stderr, _logs(host))
    return done.stdout


def _logs(host: Host) -> str:
    return "\n".join(f"{name}: {log.read_text()[-2000:]}" for name, log in host.logs.items())


def router(host: Host, *arguments: str) -> subprocess.Popen[str]:
    return host.start("router", *arguments, ready="router listening")


def carried(operator: Host, planner: Host, world: Host, **workers: Host) -> None:
    """That the operator's goals are reached by a planner, a world and workers that are where they
    are."""
    fleet(operator, planner, world, workers, "max")
    said(operator, "world", "add", "Both cups are in the kitchen.")
    first = said(operator, "goal", "add", "Bring the first cup to the hallway.", "--id", "first")
    assert "first" in first
    said(operator, "goal", "add", "Bring the second cup to the living room.", "--id", "second")
    said(operator, "plan", "create", "big-dag", "makespan")
    said(operator, "goal", "wait", "first", "second", "--timeout-s", ENDS_S)
    assert "reached" in said(operator, "goal", "show", "first")


def fleet(
    operator: Host, planner: Host, world: Host, workers: dict[str, Host], speed: str, *how: str
) -> None:
    """Its processes, each where it is; `how` its planner is started."""
    planner.start("planner", "--no-auto-plan", "--no-approval", *how, ready="planner ready")
    world.start("sim", *MISSION, "--speed", speed, ready="world home running")
    said(operator, "world", "load", "home")
    said(operator, "register", "hsr", "locobot")
    for robot, host in workers.items():
        host.start("worker", robot, ready=f"worker {robot} ready")


def test_one_host(tmp_path: Path) -> None:
    with hosts(tmp_path, "only") as (only,):
        configured(only, "one-host.json5")
        router(only)
        carried(only, only, only, hsr=only, locobot=only)


def test_an_office_with_two_floors(tmp_path: Path) -> None:
    with hosts(tmp_path, "ground", "first") as (ground, first):
        configured(ground, "office/ground-floor.json5")
        configured(first, "office/first-floor.json5", **{"ground-floor": ground.address})
        router(first)  # comes first, and finds the other one later
        router(ground)
        carried(first, ground, ground, hsr=ground, locobot=first)


def test_a_site_and_a_cloud(tmp_path: Path) -> None:
    with hosts(tmp_path, "site", "cloud") as (site, cloud):
        configured(site, "site-and-cloud/site.json5", cloud=cloud.address)
        configured(cloud, "site-and-cloud/cloud.json5")
        router(cloud, "--no-store")
        router(site, "--store")
        carried(cloud, site, site, hsr=site, locobot=site)


def test_a_robot_with_a_router_of_its_own(tmp_path: Path) -> None:
    with hosts(tmp_path, "site", "robot") as (site, robot):
        configured(site, "office/ground-floor.json5")
        configured(robot, "robot.json5", site=site.address)
        router(site)
        own = router(robot)
        carried(site, site, site, hsr=robot, locobot=site)
        own.kill()  # the robot goes over to the site's
        said(site, "goal", "add", "Bring the first cup to the kitchen.", "--id", "back", "--plan")
        said(site, "goal", "wait", "back", "--timeout-s", ENDS_S)


async def test_a_robot_that_is_cut_off_rests_and_its_work_goes_on_when_it_is_back(
    tmp_path: Path,
) -> None:
    """The robot's own world goes on beside it: nothing but its lease can stop it."""
    with hosts(tmp_path, "ground", "first") as (ground, first):
        configured(ground, "office/ground-floor.json5")
        configured(first, "office/first-floor.json5", **{"ground-floor": ground.address})
        router(ground)
        router(first)
        # At rest 15 s after the cut at the latest, and then given up.
        lease = ("--lease", "3", "--lost-after", "15")
        # So slowly that nobody is there before its lease is over: the way takes half a minute.
        fleet(ground, ground, first, {"hsr": first}, "0.5", *lease)
        said(ground, "goal", "add", "Send the hsr to the kitchen.", "--id", "there", "--plan")

        def plan() -> str:
            return said(ground, "plan", "show")

        def tasks() -> str:
            return said(ground, "task", "list", "plan-1")

        await until(lambda: "running" in tasks(), "the robot to begin")
        first.cut()
        log = first.logs["worker hsr"]
        rests = "rests: the planner was not heard of for the length of its lease"
        await until(lambda: rests in log.read_text(), "the robot to rest")
        await until(lambda: "has been away for 15 s" in plan(), "the planner to give it up")
        first.mend()
        said(ground, "goal", "wait", "there", "--timeout-s", ENDS_S)
        assert "cancelled" in plan()
