"""Zenoh's access control (`access_control` in a router's configuration), from the table of keys.

What no rule allows is denied, in both directions: what comes into a router from somebody (ingress),
and what goes from it to somebody (egress). Zenoh compares the key expression of a message with
those of the rules by inclusion: a rule for `goals/*/spec` allows to watch `goals/*/spec` and
`goals/g1/spec`, and not `goals/**`. It allows to delete `goals/*/spec`, too, all by one message:
that is for the store to refuse (`storage.deletes_tree`). Only a router answers for whatever key
(`**`): nobody else may declare so.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

from keyexpr_schema.key import Component, Delivery
from keyexpr_schema.keyspace import KEY_TREES, KEYSPACE
from keyexpr_schema.principals import ROUTER, Principal

INGRESS, EGRESS = "ingress", "egress"
MESSAGES = (
    "put", "delete", "declare_subscriber", "query", "declare_queryable", "reply",
    "liveliness_token", "declare_liveliness_subscriber", "liveliness_query",
)  # fmt: skip
"""All that Zenoh distinguishes."""


class Grant(NamedTuple):
    """Somebody may send (ingress) or be sent (egress) a kind of message on a key expression."""

    flow: str
    message: str
    keyexpr: str


_WRITES = {
    Delivery.STORED: ((INGRESS, "put delete query"), (EGRESS, "reply")),
    Delivery.LATEST: ((INGRESS, "put delete query"), (EGRESS, "reply")),
    Delivery.STREAM: ((INGRESS, "put"),),
    Delivery.SEQUENCE: ((INGRESS, "put"),),
    Delivery.TOKEN: ((INGRESS, "liveliness_token"),),
    Delivery.QUERY: ((INGRESS, "query"), (EGRESS, "reply")),
}
"""What writing a key takes; what is stored is read back by those who write it."""
_PUTS_BACK = ((INGRESS, "put query"), (EGRESS, "reply"))
_STORED_READS = (
    (INGRESS, "declare_subscriber query"),
    (EGRESS, "put delete reply"),
)  # fmt: skip
_PASSING_READS = ((INGRESS, "declare_subscriber"), (EGRESS, "put"))
_READS = {
    Delivery.STORED: _STORED_READS,
    Delivery.LATEST: _STORED_READS,
    Delivery.STREAM: _PASSING_READS,
    Delivery.SEQUENCE: _PASSING_READS,
    Delivery.TOKEN: (
        (INGRESS, "declare_liveliness_subscriber liveliness_query"),
        (EGRESS, "liveliness_token"),
    ),
    Delivery.QUERY: ((INGRESS, "declare_queryable reply"), (EGRESS, "query")),
}
"""What reading a key takes; who reads questions answers them."""


def grants(principal: Principal) -> frozenset[Grant]:
    """All that one may do, key expressions without realm."""
    return frozenset(_grants(principal))


def _grants(principal: Principal) -> Iterator[Grant]:
    for key in KEYSPACE:
        if key.readers == key.writers == Component.STORE:
            continue  # beside the realms: between routers
        if (keyexpr := principal.writes(key)) is not None:
            yield from _each(_WRITES[key.delivery], keyexpr)
        elif (keyexpr := principal.puts_back(key)) is not None:
            yield from _each(_PUTS_BACK, keyexpr)
        if (keyexpr := principal.reads(key)) is not None:
            yield from _each(_READS[key.delivery], keyexpr)
    for tree in KEY_TREES:
        keyexpr = tree.pattern()
        if principal.roles & Component.PLANNER:
            yield from _each(((INGRESS, "delete query"), (EGRESS, "reply")), keyexpr)
        if any(principal.reads(key) is not None for key in tree.keys):
            yield Grant(EGRESS, "delete", keyexpr)  # else it would not see that they are gone
    # That somebody answers at all: who is not told is not known to the router.
    yield Grant(EGRESS, "declare_queryable", "**")


def _each(kinds: tuple[tuple[str, str], ...], keyexpr: str) -> Iterator[Grant]:
    for flow, messages in kinds:
        for message in messages.split():
            yield Grant(flow, message, keyexpr)


def access_control(names: Iterable[str], realm: str) -> dict[str, Any]:
    """What goes under `access_control`, for those with these common names in a realm.

    A pure function of the table and the names. Routers (`router.main`) may do everything: each
    passes on what others are allowed. Who is not named may do nothing.
    """
    by_kind: dict[str, list[str]] = defaultdict(list)
    for name in sorted(set(names)):
        by_kind[name.partition(".")[0]].append(name)
    found = _Sections(realm)
    for kind, members in by_kind.items():
        if kind == ROUTER:
            everything = {Grant(f, m, "**") for f in (INGRESS, EGRESS) for m in MESSAGES}
            found.add(kind, members, everything)
            continue
        allowed = {
            principal.name: grants(principal)
            for principal in map(Principal.certified, members)
            if principal is not None
        }
        if not allowed:
            continue
        common = frozenset.intersection(*allowed.values())
        found.add(kind, list(allowed), common)
        for name, granted in allowed.items():
            if own := granted - common:
                found.add(name, [name], own)
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": found.rules,
        "subjects": found.subjects,
        "policies": found.policies,
    }


class _Sections:
    """The rules, subjects and policies of a configuration."""

    def __init__(self, realm: str) -> None:
        self._realm = realm
        self.rules: list[dict[str, Any]] = []
        self.subjects: list[dict[str, Any]] = []
        self.policies: list[dict[str, Any]] = []

    def add(self, title: str, names: list[str], granted: Iterable[Grant]) -> None:
        """Give something to those with these common names."""
        kinds: dict[tuple[str, str], set[str]] = defaultdict(set)
        for flow, message, keyexpr in granted:
            kinds[flow, keyexpr].add(message)
        alike: dict[tuple[str, tuple[str, ...]], list[str]] = defaultdict(list)
        for (flow, keyexpr), messages in sorted(kinds.items()):
            what = tuple(each for each in MESSAGES if each in messages)
            whole = keyexpr if keyexpr == "**" else f"{self._realm}/{keyexpr}"
            alike[flow, what].append(whole)
        ids = [f"{title} {number}" for number in range(1, len(alike) + 1)]
        self.rules += [
            {
                "id": rule,
                "permission": "allow",
                "flows": [flow],
                "messages": list(messages),
                "key_exprs": keyexprs,
            }
            for rule, ((flow, messages), keyexprs) in zip(ids, alike.items(), strict=True)
        ]
        self.subjects.append({"id": title, "cert_common_names": names})
        self.policies.append({"rules": ids, "subjects": [title]})
