"""Errors of the contract: what a caller of this package may have to handle."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime


class SchemaError(Exception):
    """Root of every error this package raises. The message is one sentence for a person."""


class InvalidId(SchemaError):
    """A name cannot be a chunk of a key expression."""


class BrokenPlugIn(SchemaError):
    """An installed package offers something that cannot be used; the message names both."""


class ForeignKey(SchemaError):
    """A key expression does not belong to the key that was asked to parse it."""


class UndecodablePayload(SchemaError):
    """Bytes on a key are not a payload of the type that the key promises."""


class NoConfigFile(SchemaError):
    """No configuration file has the name that was given."""


class Unreachable(SchemaError):
    """No router answers at the configured endpoints, or no store behind it."""

    @classmethod
    def no_router(
        cls, endpoints: Sequence[str], for_s: float | None = None, unknown: Sequence[str] = ()
    ) -> Unreachable:
        """No router answered, for `for_s` [s] if given; `unknown` are hosts with no address."""
        waited = "" if for_s is None else f" for {for_s:g} s"
        where = f"at {', '.join(endpoints)}" if endpoints else "to multicast on this network"
        return cls(
            f"no router answers {where}{waited}{cls.no_hosts(unknown)}: "
            "start one with `robotctl up` or `robotctl router`, or name another with --router"
        )

    @classmethod
    def no_store(cls, endpoints: Sequence[str]) -> Unreachable:
        """A router answered, and nobody behind it keeps values."""
        where = f" at {', '.join(endpoints)}" if endpoints else ""
        return cls(
            f"a router answers{where}, but no store behind it, so nobody knows what is there: is "
            "the router that keeps the store running, and linked with this one?"
        )

    @classmethod
    def not_let_in(cls, endpoints: Sequence[str], known: str | None = None) -> Unreachable:
        """Something listens at these endpoints, and does not talk with us; `known`: why, maybe."""
        why = "--zenoh-config says how to connect" if known is None else known
        return cls(
            f"something listens at {', '.join(endpoints)}, and lets nobody in without the right "
            f"certificate or password, if it is a router: {why}"
        )

    @staticmethod
    def no_hosts(unknown: Sequence[str]) -> str:
        """What is said of hosts that nobody here knows an address of."""
        return f" ({', '.join(unknown)}: no host of that name is known here)" if unknown else ""


class BadEndpoint(SchemaError):
    """A text is no Zenoh endpoint: nobody will ever answer there."""


class BadZenohConfig(SchemaError):
    """A Zenoh configuration file cannot be read, or contradicts what the system needs."""


class CannotListen(SchemaError):
    """A router cannot listen on an endpoint: it is taken, or none."""


class SecondStore(SchemaError):
    """Of the routers that are linked, more than one has a store."""

    @classmethod
    def of(cls, others: Sequence[str]) -> SecondStore:
        """`others` are tokens of the stores that were there before, which begin with the time."""
        since = datetime.fromtimestamp(int(others[0].partition("-")[0]) / 1e9).astimezone()
        return cls(
            f"another router that this one is linked with has a store, since {since:%Y-%m-%d %X}, "
            "and a fleet has one: start this router with --no-store"
        )


class StoreBroken(SchemaError):
    """What serves a store has met a fault of its own, and should not go on."""


class Unconfirmed(SchemaError):
    """A write that must last was not read back from storage before its deadline."""


class StoreFull(Unconfirmed):
    """A write was not taken in, since the store can write nothing until there is room."""

    @classmethod
    def because(cls, what: str, why: str) -> StoreFull:
        """`what` came of it, as the beginning of a sentence; `why`: what the store says."""
        return cls(f"{what}: {why}; free some room for the router's store, and try again")


class NotAllowed(SchemaError):
    """Access control keeps whoever has this certificate from what was tried."""

    @classmethod
    def not_known(cls, name: str, endpoints: Sequence[str]) -> NotAllowed:
        """A router has let `name` in, and nobody answers."""
        return cls(
            f"no store answers {name} at {', '.join(endpoints)}: if one is there, the router's "
            "configuration is older than that certificate; put the one that `robotctl certs` and "
            "`robotctl acl` have renewed there, and restart the router"
        )


class WriteRefused(Unconfirmed):
    """The store has not taken in a write, because that is beyond one of its limits.

    `lasting`: it never will, whatever room there comes to be.
    """

    def __init__(self, why: str, lasting: bool = False) -> None:
        super().__init__(why)
        self.lasting = lasting


class Overtaken(SchemaError):
    """A write did not hold, because somebody else has written the same key with a later stamp."""


class ClockSkewed(SchemaError):
    """The clock of this host is too far from that of the store's to write anything."""


class NoReply(SchemaError):
    """A query ended without a reply: nobody serves the key, or the server was too slow."""
