"""Over TLS with certificates on both sides: who has none, or another's, does not get in."""

from __future__ import annotations

import getpass
import json
import os
import re
import signal
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from cli.certificates.authority import Authority
from cli.certificates.identity import MAIN, Identity, Kind
from cli.processes.child_processes import free_endpoint
from fleet.stores.sqlite import SqliteStore
from keyexpr_schema.errors import Unreachable
from keyexpr_schema.transport.router import run_router
from keyexpr_schema.transport.session import SessionConfig, open_session
from keyexpr_schema.transport.zenoh_file import read_zenoh_file
from tests.support.polling import DEADLINE_S, until
from tests.support.robotctl import Robotctl

ROUTER = Identity(Kind.ROUTER, MAIN)
ANA = Identity(Kind.OPERATOR, "ana")


async def gets_in(endpoint: str, config: Path | None, wait_s: float = 0.5) -> bool:
    with suppress(Unreachable):
        there = SessionConfig((endpoint,), "home", connect_timeout_s=wait_s, zenoh_config=config)
        async with open_session(there) as session:
            return session.connected
    return False


async def test_who_has_no_certificate_of_the_authority_does_not_get_in(tmp_path: Path) -> None:
    ours = Authority.create(tmp_path / "ours", "home")
    others = Authority.create(tmp_path / "others", "home")
    endpoint = free_endpoint("tls")
    right, foreign = ours.issue(ANA).settings, others.issue(ANA).settings
    settings = read_zenoh_file(ours.issue(ROUTER).settings)
    # One that trusts our router, and shows a certificate of somebody else.
    mixed = json.loads(foreign.read_text().split("\n", 1)[1])
    mixed["transport"]["link"]["tls"]["root_ca_certificate"] = str(tmp_path / "ours" / "ca.pem")
    (tmp_path / "others" / "mixed.json5").write_text(json.dumps(mixed))
    anonymous = {"transport": {"link": {"tls": {"root_ca_certificate": "ours/ca.pem"}}}}
    (tmp_path / "anonymous.json5").write_text(json.dumps(anonymous))
    with SqliteStore(tmp_path / "store") as store:
        async with run_router((endpoint,), (), store, file=settings):
            assert not settings.lets_all_do_all
            await only_the_right(endpoint, right, foreign, tmp_path)


def found(folder: Path, name: str) -> str:
    return str(next(folder.rglob(name)))


async def only_the_right(endpoint: str, right: Path, foreign: Path, folder: Path) -> None:
    assert await gets_in(endpoint, right, DEADLINE_S)
    mixed, anonymous = folder / "others" / "mixed.json5", folder / "anonymous.json5"
    for wrong in (None, foreign, mixed, anonymous):
        assert not await gets_in(endpoint, wrong), wrong
    assert not await gets_in(endpoint.replace("tls/", "tcp/"), None)
    with pytest.raises(Unreachable, match=r"something listens at .* and lets nobody in"):
        async with open_session(SessionConfig((endpoint,), connect_timeout_s=0.5)):
            pass


@pytest.fixture
def secure(tmp_path: Path) -> Iterator[Robotctl]:
    robotctl = Robotctl("", tmp_path)
    del robotctl.env["ROBOTFLEET_ROUTER"]
    try:
        yield robotctl
    finally:
        robotctl("down")


@pytest.mark.slow
async def test_a_secure_fleet_carries_a_cup_and_robotctl_finds_its_way_in(
    secure: Robotctl, tmp_path: Path
) -> None:
    how = ("--secure", "--detach", "--backend", "kinematic", "--speed", "max", "--no-record")
    up = await secure.soon("up", "two-cups", *how)
    assert up.code == 0, up.err
    assert "on tls/127.0.0.1:" in up.out
    told = ("goal", "add", "Bring the first cup to the hallway.", "--plan", "--wait")
    done = await secure.soon(*told)
    assert done.code == 0, done.err
    assert "is reached" in done.out
    # Each has said what it said in its own name, and nobody had to be refused.
    audit = await secure.soon("--as", "somebody", "audit", "--json")
    assert {each["by"] for each in audit.data["entries"]} == {getpass.getuser()}
    assert "whose certificate is used, and not by 'somebody'" in audit.err
    health = await secure.soon("status", "--json")
    assert (health.code, "not taken in" in health.out) == (0, False)
    listed = await secure.soon("certs", "list", "--json")
    assert {"router.main", "planner", "sim", "robot.hsr", "robot.locobot"} <= {
        e["identity"] for e in listed.data
    }
    bob = await secure.soon("certs", "operator", "bob")
    assert bob.code == 0, bob.err
    end = re.search(r"`kill ([0-9]+)`, after which `robotctl up` starts its router again", bob.err)
    assert end is not None, bob.err
    os.kill(int(end[1]), signal.SIGTERM)

    async def router_again() -> bool:
        children = (await secure.soon("ps", "--json")).data["children"]
        [router] = [each for each in children if each["name"] == "router"]
        return bool(router["restarts"] == 1 and router["process"])

    await until(router_again, "the router of `up` to be started again")
    of_bob = ("--zenoh-config", found(tmp_path, "operator-bob.json5"))

    async def let_in() -> bool:
        return (await secure.soon(*of_bob, "status")).code == 0

    await until(let_in, "bob to be let in")
    revoked = await secure.soon("certs", "revoke", "operator.bob")
    assert "the fleet knows 1 revoked certificate" in revoked.out, revoked.err
    of_hsr = ("--zenoh-config", found(tmp_path, "robot-hsr.json5"))
    denied = await secure.soon(*of_hsr, "goal", "add", "Bring the second cup to the hallway.")
    assert (denied.code, denied.out) == (1, "")
    assert "Error: robot.hsr may not " in denied.err
    again = await secure.soon("up", "two-cups", "--secure", "--router", "tcp/127.0.0.1:1")
    assert again.code == 1


@pytest.mark.slow
async def test_a_robot_that_is_registered_later_gets_a_certificate_and_a_worker(
    secure: Robotctl,
) -> None:
    up = await secure.soon("up", "--secure", "--detach", "--no-record")
    assert up.code == 0, up.err
    done = await secure.soon("register", "hsr")
    assert done.code == 0, done.err

    async def served() -> bool:
        children = (await secure.soon("ps", "--json")).data["children"]
        return "worker-hsr" in [each["name"] for each in children]

    await until(served, "the worker of hsr")
    listed = await secure.soon("certs", "list", "--json")
    assert "robot.hsr" in {e["identity"] for e in listed.data}
    # The router was started again, and knows what it knew.
    shown = await secure.soon("robots", "--json")
    assert "hsr" in shown.out


def test_what_certificates_are_not_for_is_a_sentence(tmp_path: Path) -> None:
    robotctl = Robotctl("tcp/127.0.0.1:1", tmp_path)
    folder = ("--dir", str(tmp_path / "certs"))
    assert robotctl("certs", "init", *folder).code == 0
    said = robotctl("certs", "robot", "hsr", "--connect", "tcp/hall:7447", *folder)
    assert (said.code, said.err) == (
        1,
        "Error: certificates are for TLS, and tcp/hall:7447 is tcp: write tls/hall:7447\n",
    )
    assert robotctl("certs", "service", "router", *folder).err == ""
    more = robotctl("certs", "robot", "hsr", *folder)
    assert "start the router again (`robotctl router --zenoh-config router-main.json5`)" in more.err
    again = robotctl("certs", "service", "router", *folder)
    assert again.code == 0
    assert again.err.startswith("the certificate of router.main that there was is replaced, and be")
    assert "--replaced` revokes it; another router has another --name" in again.err
    listed = robotctl("certs", "list", *folder)
    assert listed.out.count("replaced") == 1
    gone = robotctl("certs", "revoke", "router.main", *folder)
    assert (gone.code, gone.out.count("is revoked")) == (0, 2)
    assert f"certs publish {tmp_path}/certs/ca.crl` tells the fleet of it" in gone.err
    missing = robotctl("certs", "publish", str(tmp_path / "none.crl"))
    assert (missing.code, missing.err) == (
        1,
        f"Error: there is no list of revoked certificates in {tmp_path}/none.crl: "
        "`robotctl certs revoke` makes it\n",
    )
    bare = robotctl("certs", "publish", *folder)
    assert (bare.code, bare.out) == (1, "")
    assert bare.err.endswith("give an operator's configuration by --zenoh-config\n")
