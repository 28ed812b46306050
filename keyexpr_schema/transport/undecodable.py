"""Reports values that a component could not decode, on a key for people to see."""

from __future__ import annotations

import hashlib

from keyexpr_schema.keyspace import UNDECODABLE
from keyexpr_schema.limits import in_force
from keyexpr_schema.payloads.system import UndecodableAddress, UndecodableValue
from keyexpr_schema.transport.link import Link
from keyexpr_schema.transport.samples import encoding_of
from keyexpr_schema.transport.trace import Trace

OTHERS = "others"
"""Where it is told how many bad values there are besides."""
LONGEST = 2_000
"""Characters of a reason."""


class UndecodableReports:
    """What one component could not decode; each distinct bad value of a key is reported once."""

    def __init__(self, link: Link, component: str, trace: Trace) -> None:
        self._link, self._component, self._trace = link, component, trace
        self._reported: dict[str, tuple[str, int]] = {}
        self._others = 0

    def report(self, keyexpr: str, data: bytes, reason: str, *, decodes: bool = False) -> None:
        """Report `data`, found at `keyexpr`, unless that was the last to be reported there.

        `decodes`: it can be read, and is of no use all the same.
        """
        if keyexpr not in self._reported and len(self._reported) >= in_force().rejects:
            self._report_others(keyexpr, reason)
            return
        value = hashlib.sha256(reason.encode() + b"\0" + data).hexdigest()
        last, count = self._reported.get(keyexpr, ("", 0))
        if last == value:
            return
        self._reported[keyexpr] = (value, count + 1)
        self._put(
            hashlib.sha256(keyexpr.encode()).hexdigest()[:12],
            UndecodableValue(
                component=self._component,
                keyexpr=keyexpr,
                reason=_shortened(reason),
                count=count + 1,
                digest=digest_of(data) if decodes else None,
            ),
        )

    def _report_others(self, keyexpr: str, reason: str) -> None:
        """Beyond the limit how many there are is told, each time that they have doubled."""
        self._others += 1
        if self._others.bit_count() == 1:
            what = f"bad values at {self._others} more keys or so, of which this is one: {reason}"
            self._put(
                OTHERS,
                UndecodableValue(
                    component=self._component,
                    keyexpr=keyexpr,
                    reason=_shortened(what),
                    count=self._others,
                ),
            )

    def _put(self, digest: str, value: UndecodableValue) -> None:
        where = UNDECODABLE.build(UndecodableAddress(self._component, digest))
        payload = UNDECODABLE.encode(value)
        self._trace.note("put", UNDECODABLE, where)
        self._link.send_soon(where, payload, encoding_of(UNDECODABLE), block=True)


def _shortened(reason: str) -> str:
    """A reason that quotes what somebody has put is no longer than a page."""
    return reason if len(reason) <= LONGEST else f"{reason[:LONGEST]}…"


def digest_of(data: bytes) -> str:
    """What tells one value from others, in `UndecodableValue.digest`."""
    return hashlib.sha256(data).hexdigest()
