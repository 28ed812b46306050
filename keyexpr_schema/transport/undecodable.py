"""Reports values that a component could not decode, on a key for people to see."""

from __future__ import annotations

import hashlib

from keyexpr_schema.keyspace import UNDECODABLE
from keyexpr_schema.payloads.system import UndecodableAddress, UndecodableValue
from keyexpr_schema.transport.link import Link
from keyexpr_schema.transport.samples import encoding_of
from keyexpr_schema.transport.trace import Trace


class UndecodableReports:
    """What one component could not decode; each distinct bad value of a key is reported once."""

    def __init__(self, link: Link, component: str, trace: Trace) -> None:
        self._link, self._component, self._trace = link, component, trace
        self._reported: dict[str, tuple[str, int]] = {}

    def report(self, keyexpr: str, data: bytes, reason: str, *, decodes: bool = False) -> None:
        """Report `data`, found at `keyexpr`, unless that was the last to be reported there.

        `decodes`: it can be read, and is of no use all the same.
        """
        value = hashlib.sha256(reason.encode() + b"\0" + data).hexdigest()
        last, count = self._reported.get(keyexpr, ("", 0))
        if last == value:
            return
        self._reported[keyexpr] = (value, count + 1)
        digest = hashlib.sha256(keyexpr.encode()).hexdigest()[:12]
        where = UNDECODABLE.build(UndecodableAddress(self._component, digest))
        payload = UNDECODABLE.encode(
            UndecodableValue(
                component=self._component,
                keyexpr=keyexpr,
                reason=reason,
                count=count + 1,
                digest=digest_of(data) if decodes else None,
            )
        )
        self._trace.note("put", UNDECODABLE, where)
        self._link.send_soon(where, payload, encoding_of(UNDECODABLE), block=True)


def digest_of(data: bytes) -> str:
    """What tells one value from others, in `UndecodableValue.digest`."""
    return hashlib.sha256(data).hexdigest()
