"""Access control as a function of the table: what each role is given of every row, and no more."""

from __future__ import annotations

import json
from typing import Any

import pytest
import zenoh

from fleet.core.state import State
from fleet.service.put_back import KNOWN, known_at
from keyexpr_schema.access_control import MESSAGES, access_control, grants
from keyexpr_schema.key import Component, Delivery, Key
from keyexpr_schema.keyspace import (
    FACT,
    GOAL_SPEC,
    KEY_TREES,
    KEYSPACE,
    PLAN_REQUEST,
    PLANNER_STATUS,
    REPORT,
    ROBOT_STATE,
    STORE_REPLACE,
)
from keyexpr_schema.payloads.requests import RequestAddress
from keyexpr_schema.principals import Principal

NAMES = ("robot.hsr", "robot.locobot", "operator.ana", "planner", "sim", "recorder", "router.main")
ROLES = {
    "robot.hsr": Component.WORKER,
    "operator.ana": Component.PERSON,
    "planner": Component.PLANNER,
    "sim": Component.SIMULATION,
    "recorder": Component.RECORDER,
}
WRITING = {"put", "delete", "liveliness_token"}
SIGNED = {"robot.hsr": "worker-hsr", "planner": "planner", "recorder": "recorder", "sim": "sim"}


def rows() -> list[Key[Any, Any]]:
    return [key for key in KEYSPACE if key.writers != Component.STORE]


def keyexpr(key: Key[Any, Any], who: str, robot: str) -> str:
    """One key of a row, as `who` signs it where it is signed."""
    chunks = dict.fromkeys(key.address.__struct_fields__, "x")
    chunks |= {"robot": robot, "component": SIGNED.get(who, "robotctl"), "asker": who}
    return key.template.format(**chunks)


def in_column(column: Component, who: str, key: Key[Any, Any], robot: str) -> bool:
    if ROLES[who] & column:
        return True
    own = who == f"robot.{robot}" or "{robot}" not in key.template
    return who.startswith("robot.") and Component.OWN_WORKER in column and own


def decided(control: dict[str, Any], who: str, flow: str, message: str, at: str) -> bool:
    """As Zenoh decides: a rule's key expression must include the message's."""
    subjects = {s["id"] for s in control["subjects"] if who in s["cert_common_names"]}
    rules = {r for p in control["policies"] if subjects & set(p["subjects"]) for r in p["rules"]}
    return any(
        zenoh.KeyExpr(allowed).includes(zenoh.KeyExpr(at))
        for rule in control["rules"]
        if rule["id"] in rules and flow in rule["flows"] and message in rule["messages"]
        for allowed in rule["key_exprs"]
    )


@pytest.fixture(scope="module")
def control() -> dict[str, Any]:
    return access_control(NAMES, "home")


@pytest.mark.parametrize("who", ROLES)
def test_every_row_gives_each_role_what_its_columns_say_and_no_more(
    control: dict[str, Any], who: str
) -> None:
    seen = {True: 0, False: 0}
    for key in rows():
        for robot in ("hsr", "locobot"):
            at = f"home/{keyexpr(key, who, robot)}"
            writes = in_column(key.writers, who, key, robot)
            reads = in_column(key.readers, who, key, robot)
            over = who == "planner" and any(key in tree.keys for tree in KEY_TREES)
            for message in ("put", "delete", "liveliness_token"):
                kinds = {
                    "liveliness_token": (Delivery.TOKEN,),
                    "delete": (Delivery.STORED, Delivery.LATEST),
                }
                fits = key.delivery in kinds.get(
                    message, tuple(set(Delivery) - {Delivery.TOKEN, Delivery.QUERY})
                )
                lost = who == "planner" and key.put_back and message == "put"
                expected = fits and (writes or (over and message == "delete") or lost)
                assert decided(control, who, "ingress", message, at) == expected, (message, at)
                seen[expected] += 1
            serves = reads and key.delivery is Delivery.QUERY
            for message in ("declare_queryable", "reply"):
                assert decided(control, who, "ingress", message, at) == serves, (message, at)
            watches = reads and key.delivery not in (Delivery.QUERY, Delivery.TOKEN)
            assert decided(control, who, "ingress", "declare_subscriber", at) == watches, at
            assert decided(control, who, "egress", "put", at) == watches, at
            sees = reads and key.delivery is Delivery.TOKEN
            for message in ("declare_liveliness_subscriber", "liveliness_query"):
                assert decided(control, who, "ingress", message, at) == sees, (message, at)
            assert decided(control, who, "egress", "liveliness_token", at) == sees, at
    assert min(seen.values()) > 5


def test_nobody_but_routers_answers_for_everything_or_sweeps_it_away(
    control: dict[str, Any],
) -> None:
    for who in (*ROLES, "robot.new"):
        for wide in ("**", "home/**", "home/goals/**", "home/*/*/spec", "home/robots/**"):
            for message in MESSAGES:
                assert not decided(control, who, "ingress", message, wide), (who, message, wide)
    for message in MESSAGES:
        assert decided(control, "router.main", "ingress", message, "**")
        assert not decided(control, "robot.new", "ingress", message, "home/goals/g/spec")


def test_the_planner_alone_deletes_what_is_over(control: dict[str, Any]) -> None:
    for tree in KEY_TREES:
        at = f"home/{tree.build('p1')}"
        deleters = {who for who in ROLES if decided(control, who, "ingress", "delete", at)}
        one_key = "*" not in at
        assert "planner" in deleters
        assert one_key or deleters == {"planner"}, at
        # Who watches some of it hears that it is gone.
        for who in ROLES:
            watches = any(in_column(key.readers, who, key, "hsr") for key in tree.keys)
            assert decided(control, who, "egress", "delete", at) or not watches, (who, at)


def test_a_configuration_has_a_rule_for_each_kind_and_one_for_what_is_a_robots_own() -> None:
    few, many = (
        access_control([*NAMES, *(f"robot.r{n}" for n in range(count))], "home")
        for count in (1, 50)
    )
    each = (len(many["rules"]) - len(few["rules"])) / 49
    assert each == int(each)  # the same for every robot
    assert each < 12
    (own,) = [s for s in many["subjects"] if s["id"] == "robot.r7"]
    assert own["cert_common_names"] == ["robot.r7"]
    zenoh.Config().insert_json5("access_control", json.dumps(many))


def test_who_is_of_no_fleet_is_given_nothing() -> None:
    control = access_control(["www.example.org", "king"], "home")
    assert (control["default_permission"], control["rules"]) == ("deny", [])


@pytest.mark.parametrize(
    ("name", "key", "at", "objection"),
    [
        ("robot.hsr", ROBOT_STATE, "robots/hsr/state", None),
        ("robot.hsr", FACT, "world/facts/cup_1/at", None),
        (
            "robot.hsr",
            ROBOT_STATE,
            "robots/locobot/state",
            "robot.hsr may not write robots/locobot/state, "
            "which is for people and that robot's worker",
        ),
        ("workers", REPORT, "robots/locobot/reports/p/t/1", None),
        ("worker-hsr", REPORT, "robots/hsr/reports/p/t/1", None),
        ("my-program", GOAL_SPEC, "goals/g1/spec", None),
        (
            "operator.ana",
            PLANNER_STATUS,
            "planner/status",
            "operator.ana may not write planner/status, which is for the planner",
        ),
        (
            "robot.hsr",
            STORE_REPLACE,
            "store/replace/planner",
            "robot.hsr may not write store/replace/planner, which is for each under its own name",
        ),
    ],
)
def test_who_may_not_write_is_told_who_may(
    name: str, key: Key[Any, Any], at: str, objection: str | None
) -> None:
    assert Principal.of(name).objection_to_write(key, at) == objection


def test_what_a_store_has_lost_the_planner_puts_back_and_does_not_delete() -> None:
    planner, hsr = Principal.of("planner"), Principal.of("robot.hsr")
    lost = [key for key in KEYSPACE if key.put_back]
    assert set(lost) == set(KNOWN)
    for key in lost:
        address = key.address(**dict.fromkeys(key.address.__struct_fields__, "x"))
        at = key.build(address)
        assert planner.objection_to_write(key, at) is None
        over = any(tree.is_of_one(at) for tree in KEY_TREES)
        assert (planner.objection_to_delete(key, at) is None) is (key is FACT or over)
        assert (hsr.objection_to_write(key, at) is None) is (key is FACT)
        assert planner.objection_to_read(key, at) is None
        assert known_at(State(), key, address) is None  # it knows where it would stand
    assert known_at(State(), PLAN_REQUEST, RequestAddress("x")) is None


def test_what_is_over_is_the_planners_to_delete() -> None:
    planner, ana = Principal.of("planner"), Principal.of("operator.ana")
    assert planner.objection_to_delete(GOAL_SPEC, "goals/g1/*") is None
    assert "may not write goals/*/*" in str(planner.objection_to_delete(GOAL_SPEC, "goals/*/*"))
    assert ana.objection_to_delete(GOAL_SPEC, "goals/g1/spec") is None
    assert ana.objection_to_delete(GOAL_SPEC, "goals/g1/*") is not None


def test_grants_are_of_the_table_alone() -> None:
    assert grants(Principal.of("planner")) == grants(Principal.of("planner"))
    assert grants(Principal.of("robot.a")) != grants(Principal.of("robot.b"))
