"""Access control at work: routers let everybody do what the table gives them, and nothing else."""

from __future__ import annotations

import json
import re
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import AsyncExitStack, asynccontextmanager, contextmanager
from pathlib import Path
from typing import Any

import pytest
import zenoh
from cryptography.hazmat.primitives.asymmetric import rsa
from zenoh import handlers

from cli.certificates.authority import Authority
from cli.certificates.identity import Identity
from cli.certificates.revocation_list import read_lists
from cli.processes.child_processes import free_endpoint
from fleet.stores.sqlite import SqliteStore
from keyexpr_schema.errors import NotAllowed, Unconfirmed, WriteRefused
from keyexpr_schema.key import Component, Delivery, Key
from keyexpr_schema.key_lookup import key_of
from keyexpr_schema.keyspace import (
    FACT,
    GOAL_SPEC,
    GOAL_TREE,
    HOLD,
    KEYSPACE,
    ORDER,
    PLANNER_ALIVE,
    PLANNER_STATUS,
    REPORT,
    REVOCATIONS,
    ROBOT_ALIVE,
    ROBOT_STATE,
    SIM_MOTION,
    STOP,
    STORE_REPLACE,
    UNDECODABLE,
)
from keyexpr_schema.payloads.goals import Goal, GoalAddress
from keyexpr_schema.payloads.holds import Hold, HoldAddress, HoldKind
from keyexpr_schema.payloads.robots import AliveAddress
from keyexpr_schema.payloads.system import (
    PlannerAddress,
    PlannerStatus,
    StoreAskerAddress,
    StoreReplaceQuery,
)
from keyexpr_schema.payloads.world import Fact, FactAddress
from keyexpr_schema.transport.connecting import zenoh_config
from keyexpr_schema.transport.credentials import Credentials, of_client, of_router
from keyexpr_schema.transport.revocations import shown as shown_list
from keyexpr_schema.transport.router import run_router
from keyexpr_schema.transport.samples import encoding_of
from keyexpr_schema.transport.session import Session, SessionConfig, open_session
from keyexpr_schema.transport.signatures import Signer
from keyexpr_schema.transport.zenoh_file import ZenohFile, read_zenoh_file
from tests.support.other_keys import rekey
from tests.support.polling import DEADLINE_S, until

ROLES = {
    "planner": Component.PLANNER,
    "robot.hsr": Component.WORKER,
    "operator.ana": Component.PERSON,
    "sim": Component.SIMULATION,
    "recorder": Component.RECORDER,
}
COMPONENTS = {"robot.hsr": "worker-hsr", "operator.ana": "robotctl"}
ROWS = [key for key in KEYSPACE if key.writers != Component.STORE]
VALUES = set(Delivery) - {Delivery.TOKEN, Delivery.QUERY}
EPOCH = 2**62
BLOCK = zenoh.CongestionControl.BLOCK
"""Else Zenoh leaves out what a busy machine has no time for."""


def signer_of(credentials: Credentials | None) -> Signer:
    assert credentials is not None
    assert credentials.signer is not None
    return credentials.signer


class Fleet:
    """A router that asks for certificates, and those who have one; ana's is of an RSA key, and
    `robot.new` came too late."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.authority = Authority.create(folder / "certs", "home")
        self.endpoint = free_endpoint("tls")
        for name in ("router.main", "operator.bob", "robot.locobot", *ROLES):
            self.authority.issue(Identity.parse(name))
        rekey(self.authority, "operator.ana", rsa.generate_private_key(65537, 2048))
        self.authority.renew_access()
        self.router_file = read_zenoh_file(self.settings("router.main"))
        self.signer = signer_of(of_router(self.router_file))
        self.authority.issue(Identity.parse("robot.new"))

    def settings(self, name: str) -> Path:
        return self.authority.files(Identity.parse(name)).settings

    @asynccontextmanager
    async def up(self, file: ZenohFile | None = None) -> AsyncIterator[None]:
        with SqliteStore(self.folder / "store") as store:
            async with run_router((self.endpoint,), (), store, file=file or self.router_file):
                yield

    @asynccontextmanager
    async def session(self, name: str, wait_s: float = DEADLINE_S) -> AsyncIterator[Session]:
        config = SessionConfig(
            (self.endpoint,),
            "home",
            COMPONENTS.get(name, name),
            connect_timeout_s=wait_s,
            zenoh_config=self.settings(name),
        )
        async with open_session(config) as session:
            yield session

    @contextmanager
    def raw(self, name: str) -> Iterator[zenoh.Session]:
        """Zenoh's own session: it looks into no table before it sends."""
        file = read_zenoh_file(self.settings(name))
        config = zenoh_config("client", connect=[self.endpoint], namespace="home", file=file)
        with zenoh.open(config) as session:
            yield session


def put_signed(session: zenoh.Session, signer: Signer, at: str, data: bytes) -> dict[str, Any]:
    """Put as Zenoh does, with a signature beside it; how, to say it again."""
    stamp = session.new_timestamp()
    signed = signer.attachment(f"home/{at}", str(stamp), data)
    how = {"timestamp": stamp, "attachment": signed, "congestion_control": BLOCK}
    session.put(at, data, encoding=encoding_of(key_of(at)), **how)
    return how


def shown(sample: zenoh.Sample) -> str:
    return f"{'PUT' if sample.kind == zenoh.SampleKind.PUT else 'DELETE'} {sample.key_expr}"


def hearing(note: Callable[[str], object]) -> Any:
    """What calls `note` in the order of arrival: else Zenoh has a thread for each subscriber."""
    return handlers.Callback(lambda sample: note(shown(sample)), indirect=False)


def keyexpr(key: Key[Any, Any], who: str, robot: str) -> str:
    chunks: dict[str, Any] = dict.fromkeys(key.address.__struct_fields__, "x")
    if "attempt" in chunks:
        chunks["attempt"] = 1
    chunks |= {"robot": robot, "component": COMPONENTS.get(who, who), "asker": who}
    return key.template.format(**chunks)


def given(column: Component, who: str, key: Key[Any, Any], robot: str) -> bool:
    own = "{robot}" not in key.template or who == f"robot.{robot}"
    return bool(ROLES[who] & column) or (
        who.startswith("robot.") and Component.OWN_WORKER in column and own
    )


def every_key(who: str) -> dict[str, tuple[Key[Any, Any], str]]:
    return {keyexpr(key, who, robot): (key, robot) for key in ROWS for robot in ("hsr", "locobot")}


def written_by(who: str, deliveries: set[Delivery]) -> set[str]:
    return {
        at
        for at, (key, robot) in every_key(who).items()
        if key.delivery in deliveries and given(key.writers, who, key, robot)
    }


def read_by(who: str, deliveries: set[Delivery]) -> set[str]:
    return {
        at
        for at, (key, robot) in every_key(who).items()
        if key.delivery in deliveries and given(key.readers, who, key, robot)
    }


async def test_every_row_of_the_table_as_every_role(tmp_path: Path) -> None:
    fleet = Fleet(tmp_path)
    async with fleet.up():
        with fleet.raw("router.main") as router:
            heard: list[str] = []
            router.declare_subscriber("**", hearing(heard.append))
            for who in ROLES:
                with fleet.raw(who) as session:
                    await _puts(session, who, heard)
                    await _watches(session, router, who, fleet.signer)
                    await _tokens(session, router, who)
                    await _serves(session, router, who)


async def _puts(session: zenoh.Session, who: str, heard: list[str]) -> None:
    heard.clear()
    for at in every_key(who):
        session.put(at, b"{}", congestion_control=BLOCK)
        session.delete(at, congestion_control=BLOCK)
    # What comes down one link comes in its order: behind the last there is nothing more.
    last = keyexpr(UNDECODABLE, who, "hsr")
    session.put(last, b"last", congestion_control=BLOCK)
    await until(lambda: heard.count(f"PUT {last}") == 2, f"the last of {who}")
    puts = {line.partition(" ")[2] for line in heard if line.startswith("PUT ")}
    lost = {at for at, (key, _) in every_key(who).items() if key.put_back and who == "planner"}
    assert puts == written_by(who, VALUES) | lost, who
    deleted = {line.partition(" ")[2] for line in heard if line.startswith("DELETE ")}
    if who != "planner":
        assert deleted == written_by(who, {Delivery.STORED, Delivery.LATEST}), who
    else:
        over = {at for at in every_key(who) if at.split("/")[0] in OVER and "spec" not in at}
        assert deleted >= written_by(who, {Delivery.STORED, Delivery.LATEST})
        assert {at.split("/")[0] for at in deleted - written_by(who, VALUES)} <= OVER, over


OVER = {"plans", "robots", "goals", "requests", "deletions", "closures"}
"""Of these the planner deletes what people and robots have written, when it is over."""


async def _watches(session: zenoh.Session, router: zenoh.Session, who: str, signer: Signer) -> None:
    heard: set[str] = set()
    for at in every_key(who):
        session.declare_subscriber(at, hearing(heard.add))
    # Everybody minds stops; Zenoh answers behind what was declared before.
    last = keyexpr(STOP, who, "hsr")
    list(session.get(last, timeout=10.0))
    for at in sorted(every_key(who), key=lambda at: at == last):
        put_signed(router, signer, at, b"{}")
    await until(lambda: f"PUT {last}" in heard, f"the last for {who}")
    assert {line.partition(" ")[2] for line in heard} == read_by(who, VALUES), who
    asked = {at for at in every_key(who) if at in read_by(who, {Delivery.STORED})}
    for at, (key, _) in every_key(who).items():
        # Of a list of revoked certificates it is the authority who says that it is one.
        if key.delivery is Delivery.STORED and key is not REVOCATIONS:
            found = [reply for reply in session.get(at, timeout=10.0) if reply.ok is not None]
            allowed = at in asked or at in written_by(who, VALUES)
            over = who == "planner" and at.split("/")[0] in OVER
            assert bool(found) == allowed or (over and found), (who, at)


async def _tokens(session: zenoh.Session, router: zenoh.Session, who: str) -> None:
    tokens = [
        (at, key) for at, (key, _) in every_key(who).items() if key.delivery is Delivery.TOKEN
    ]
    held = [session.liveliness().declare_token(at) for at, _ in tokens]
    list(session.get(keyexpr(STOP, who, "hsr"), timeout=10.0))
    seen = {str(r.ok.key_expr) for r in router.liveliness().get("**", timeout=10.0) if r.ok}
    assert seen == written_by(who, {Delivery.TOKEN}), who
    for token in held:
        token.undeclare()
    others = [router.liveliness().declare_token(at) for at, _ in tokens]
    list(router.get("nothing", timeout=10.0))
    shown = {
        str(reply.ok.key_expr)
        for at, _ in tokens
        for reply in session.liveliness().get(at, timeout=10.0)
        if reply.ok
    }
    assert shown == read_by(who, {Delivery.TOKEN}), who
    for token in others:
        token.undeclare()


async def _serves(session: zenoh.Session, router: zenoh.Session, who: str) -> None:
    """Who declares that it answers for a key is asked, and believed, where the table says so."""

    def answer(query: zenoh.Query) -> None:
        with query:
            query.reply(query.key_expr, b"mine")

    served = [session.declare_queryable(at, answer) for at in every_key(who)]
    wide = session.declare_queryable("**", answer)
    list(session.get(keyexpr(STOP, who, "hsr"), timeout=10.0))
    answered = {
        at
        for at in every_key(who)
        for reply in router.get(at, timeout=10.0, target=zenoh.QueryTarget.ALL)
        if reply.ok is not None and reply.ok.payload.to_bytes() == b"mine"
    }
    assert answered == read_by(who, {Delivery.QUERY}), who
    for each in (*served, wide):
        each.undeclare()


G1 = GoalAddress("g1")
FORGED = Goal(goal="g1", text="forged")


async def test_attacks_with_a_certificate_of_ones_own_come_to_nothing(tmp_path: Path) -> None:
    fleet = Fleet(tmp_path)
    async with AsyncExitStack() as stack:
        await stack.enter_async_context(fleet.up())
        enter = stack.enter_async_context
        ana, planner = (
            await enter(fleet.session("operator.ana")),
            await enter(fleet.session("planner")),
        )
        await ana.confirm(GOAL_SPEC, G1, Goal(goal="g1", text="Bring the cup."))
        claimed = PlannerStatus(epoch=3, incarnation="p1")
        assert await planner.update(PLANNER_STATUS, PlannerAddress(), lambda _: claimed) == claimed
        await enter(planner.token(PLANNER_ALIVE, PLANNER_ALIVE.parse("planner/alive/p1")))
        heard: list[str] = []
        router = stack.enter_context(fleet.raw("router.main"))
        for pattern in ("goals/**", "robots/**", "planner/**", "stops/**"):
            router.declare_subscriber(pattern, hearing(heard.append))
        hsr = stack.enter_context(fleet.raw("robot.hsr"))
        person = stack.enter_context(fleet.raw("operator.ana"))

        # Another robot's report reaches its goal; orders and a status of an epoch that locks out.
        hsr.put("robots/locobot/reports/plan-1/t1/1", b'{"state": "succeeded"}')
        for thief in (hsr, person):
            thief.put("robots/hsr/orders/plan-1/t1", b'{"epoch": %d}' % EPOCH)
            thief.put("planner/status", b'{"epoch": %d, "incarnation": "evil"}' % EPOCH)
            thief.delete("**")
            thief.delete("goals/g1/**")
        # Ana may delete each goal. By one message she deletes none.
        person.delete("goals/*/spec")
        person.put("goals/*/spec", GOAL_SPEC.encode(FORGED))
        # By compare and set, in another's name and in one's own.
        stolen = PlannerStatus(epoch=EPOCH, incarnation="evil")
        for asker in ("planner", "operator.ana"):
            query = StoreReplaceQuery(
                keyexpr="planner/status", value=PLANNER_STATUS.encode(stolen).decode()
            )
            replies = person.get(
                STORE_REPLACE.build(StoreAskerAddress(asker)), payload=STORE_REPLACE.encode(query)
            )
            assert [r.err.payload.to_string() for r in replies if r.err is not None] == (
                ["operator.ana may not write planner/status, which is for the planner"]
                if asker == "operator.ana"
                else []
            )
        # Another robot's token, and its motion.
        held = hsr.liveliness().declare_token("robots/locobot/alive/evil")
        moved: list[str] = []
        sim = stack.enter_context(fleet.raw("sim"))
        sim.declare_queryable("sim/robots/*/motion", lambda q: moved.append(str(q.key_expr)))
        assert list(hsr.get("sim/robots/locobot/motion", payload=b"{}", timeout=10.0)) == []
        # Who answers for keys that are not hers is not asked.
        for pattern in ("goals/**", "**", "goals/g1/spec", "store/changes", "planner/question"):
            hsr.declare_queryable(pattern, lambda q: (q.reply(q.key_expr, b"evil"), q.drop()))

        list(hsr.get("stops/x", timeout=10.0))
        person.put("stops/last", b"{}", congestion_control=BLOCK)
        await until(lambda: "PUT stops/last" in heard, "the last")
        assert set(heard) <= {"PUT stops/last", "DELETE goals/*/spec", "PUT goals/*/spec"}
        assert moved == []
        assert await planner.list(GOAL_SPEC) == {G1: Goal(goal="g1", text="Bring the cup.")}
        assert (await ana.get(GOAL_SPEC, G1)) == Goal(goal="g1", text="Bring the cup.")
        assert await planner.get(PLANNER_STATUS, PlannerAddress()) == claimed
        assert await planner.list(REPORT) == await planner.list(ORDER) == {}
        async with planner.watch_tokens(ROBOT_ALIVE) as tokens:
            await tokens.synced()
            assert tokens.alive == set()
        held.undeclare()
        await planner.delete_tree(GOAL_TREE, "g1")
        assert await ana.list(GOAL_SPEC) == {}
        await _names_of_others(fleet, ana, stack)


def told(subject: str, value: str, source: str, by: str = "") -> Fact:
    return Fact(subject=subject, relation="at", value=value, source=source, by=by)


async def _names_of_others(fleet: Fleet, ana: Session, stack: AsyncExitStack) -> None:
    """Who has a certificate says things in no other name than its own, in whatever way."""
    enter = stack.enter_async_context
    bob, hsr = await enter(fleet.session("operator.bob")), await enter(fleet.session("robot.hsr"))
    watch = await enter(ana.watch(GOAL_SPEC, FACT))
    await watch.synced()
    forged = "operator.bob has signed it, and it says that it is from 'ana', not bob"
    as_ana = Goal(goal="g2", text="forged", said_by="ana")
    with pytest.raises(WriteRefused, match=re.escape(f"goals/g2/spec is not stored: {forged}")):
        await bob.confirm(GOAL_SPEC, GoalAddress("g2"), as_ana)
    with pytest.raises(Unconfirmed, match=r"operator\.bob has signed it, .* 'ana', not bob"):
        await bob.create(GOAL_SPEC, GoalAddress("g2"), as_ana)
    of_locobot = told("cup", "hall", "locobot")
    with pytest.raises(WriteRefused, match=r"robot\.hsr has signed it, .* 'locobot', not hsr"):
        await hsr.confirm(FACT, FactAddress.of(of_locobot.key), of_locobot)
    raw = stack.enter_context(fleet.raw("operator.bob"))
    at = GOAL_SPEC.build(GoalAddress("g3"))
    raw.put(at, GOAL_SPEC.encode(as_ana), congestion_control=BLOCK)  # nobody has signed it

    # What ana has said once, and hsr has seen otherwise since, is not her last word again.
    signer = signer_of(of_client(read_zenoh_file(fleet.settings("operator.ana"))))
    fact = FACT.encode(told("cup", "kitchen", "person", "ana"))
    address = FactAddress.of(of_locobot.key)
    her = stack.enter_context(fleet.raw("operator.ana"))
    how = put_signed(her, signer, FACT.build(address), fact)
    await until_stored(ana, address, "kitchen")
    await hsr.confirm(FACT, address, told("cup", "hall", "hsr"))
    raw.put(FACT.build(address), fact, encoding=encoding_of(FACT), **how)
    list(raw.get("stops/x", timeout=10.0))  # what was put has come: the answer is behind it
    # Compare and set is signed by the router, and believed by who hears it.
    mine = Goal(goal="g4", text="mine", said_by="bob")
    assert await bob.create(GOAL_SPEC, GoalAddress("g4"), mine)

    seen = []
    async for change in watch:
        seen.append(change)
        if change.value == mine:
            break
    assert [each.value for each in seen if each.key is GOAL_SPEC] == [mine]
    # What the store says has a receipt, and may come in between.
    passed = [each.value.value for each in seen if each.key is FACT and not each.received]
    assert passed.count("kitchen") <= 1
    assert "hall" in [each.value.value for each in seen if each.key is FACT]
    assert (await ana.get(FACT, address)) == told("cup", "hall", "hsr")
    assert await ana.list(GOAL_SPEC) == {GoalAddress("g4"): mine}
    rejects = {each.keyexpr: each.reason for each in (await ana.list(UNDECODABLE)).values()}
    assert forged in rejects["goals/g2/spec"]
    assert "nobody has signed it" in rejects["goals/g3/spec"]
    assert "'locobot', not hsr" in rejects[FACT.build(address)]
    assert "the store has not taken in" in str((await ana.store_troubles()).refusing)

    # Who may delete something signs that.
    g4 = GOAL_SPEC.build(GoalAddress("g4"))
    raw.delete(g4, timestamp=raw.new_timestamp(), congestion_control=BLOCK)
    list(raw.get("stops/x", timeout=10.0))
    assert await ana.list(GOAL_SPEC) == {GoalAddress("g4"): mine}

    async def reported() -> bool:
        told = {each.keyexpr: each.reason for each in (await ana.list(UNDECODABLE)).values()}
        return "nobody has signed that it is deleted" in told.get(g4, "")

    await until(reported, "that the deletion is not taken in")
    assert watch.exists(GOAL_SPEC, GoalAddress("g4"))
    await bob.delete(GOAL_SPEC, GoalAddress("g4"))
    assert await ana.list(GOAL_SPEC) == {}
    await _revoked(fleet, ana, bob, raw)


async def _revoked(fleet: Fleet, ana: Session, bob: Session, raw: zenoh.Session) -> None:
    """Whose certificate is revoked says nothing more to anybody, though no router was started
    again: not to who has listened before, nor to who comes later, nor to the store."""
    signer = signer_of(of_client(read_zenoh_file(fleet.settings("operator.bob"))))
    fleet.authority.revoke([Identity.parse("operator.bob")])
    (list_,) = read_lists(fleet.authority.revocations)
    await ana.confirm(REVOCATIONS, *shown_list(list_))
    at, goal = GoalAddress("g5"), Goal(goal="g5", text="Bring it.", said_by="bob")
    async with fleet.session("planner") as planner, planner.watch(GOAL_SPEC) as watch:
        await watch.synced()
        with pytest.raises(WriteRefused, match=r"certificate of operator\.bob, .* is revoked"):
            await bob.confirm(GOAL_SPEC, at, goal)
        with pytest.raises(Unconfirmed, match=r"certificate of operator\.bob, .* is revoked"):
            await bob.create(GOAL_SPEC, at, goal)
        put_signed(raw, signer, GOAL_SPEC.build(at), GOAL_SPEC.encode(goal))

        async def heard_by_nobody() -> bool:
            told = (await ana.list(UNDECODABLE)).items()
            return {"robotctl", "planner"} <= {
                where.component for where, each in told if "bob, who has signed" in each.reason
            }

        await until(heard_by_nobody, "both to say that they have not taken it in")
        assert not watch.exists(GOAL_SPEC, at)
    assert await ana.list(GOAL_SPEC) == {}


async def until_stored(session: Session, address: FactAddress, value: str) -> None:
    async def stored() -> bool:
        fact = await session.get(FACT, address)
        return fact is not None and fact.value == value

    await until(stored, f"{value} to be stored")


async def test_who_may_not_is_told_so_at_once_and_in_a_sentence(tmp_path: Path) -> None:
    fleet = Fleet(tmp_path)
    async with fleet.up():
        async with fleet.session("robot.hsr") as hsr:
            with pytest.raises(
                NotAllowed, match=r"robot\.hsr may not write goals/g1/spec, which is"
            ):
                await hsr.confirm(GOAL_SPEC, G1, FORGED)
            with pytest.raises(NotAllowed, match=r"may not write goals/g1/spec"):
                await hsr.delete(GOAL_SPEC, G1)
            with pytest.raises(
                NotAllowed, match=r"may not read goals/\*/spec, which is for people"
            ):
                await hsr.list(GOAL_SPEC)
            with pytest.raises(
                NotAllowed, match=r"robots/locobot/alive/a, which is for that robot"
            ):
                hsr.token(ROBOT_ALIVE, AliveAddress("locobot", "a"))
            with pytest.raises(NotAllowed, match=r"may not write sim/robots/locobot/motion"):
                address = SIM_MOTION.parse("sim/robots/locobot/motion")
                await hsr.query(SIM_MOTION, address, None)
            assert await hsr.list(ROBOT_STATE) == {}
        with pytest.raises(NotAllowed, match=r"no store answers robot\.new at tls/.*restart"):
            async with fleet.session("robot.new", wait_s=10.0):
                pass


async def test_a_router_with_older_rules_keeps_a_write_and_the_sentence_says_that_it_may(
    tmp_path: Path,
) -> None:
    fleet = Fleet(tmp_path)
    control = fleet.authority.access_control()
    for rule in control["rules"]:
        if "put" in rule["messages"]:
            rule["key_exprs"] = [each for each in rule["key_exprs"] if "/holds/" not in each] or [
                "x"
            ]
    path = fleet.router_file.path
    settings = {**json.loads(path.read_text().split("\n", 1)[1]), "access_control": control}
    path.write_text(json.dumps(settings))
    async with fleet.up(read_zenoh_file(path)), fleet.session("operator.ana") as ana:
        hold = Hold(hold="h1", kind=HoldKind.PAUSE)
        await ana.store_troubles()  # the store has answered, however short the wait is then
        with pytest.raises(Unconfirmed, match=r"access control may keep operator\.ana from that"):
            await ana.confirm(HOLD, HoldAddress("h1"), hold, 0.5)
