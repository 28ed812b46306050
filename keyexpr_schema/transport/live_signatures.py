"""What passes on a link, judged before it is believed, by who knows an authority.

What a store of ours says was judged when it came in. What passes was not: it may be forged, or said
again by somebody who has heard it.
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

from keyexpr_schema.authors import is_signed
from keyexpr_schema.key import Key
from keyexpr_schema.keyspace import REVOCATIONS, STOP
from keyexpr_schema.payloads.system import AuthorityAddress, Revocations
from keyexpr_schema.transport.attachments import Attachment
from keyexpr_schema.transport.heard import Heard
from keyexpr_schema.transport.router_presence import RouterPresence
from keyexpr_schema.transport.samples import Sample
from keyexpr_schema.transport.signatures import Authority, Judged
from keyexpr_schema.transport.stamps import time_s_of_stamp
from keyexpr_schema.transport.trace import Trace

REMEMBERED_S = 60.0
"""What is older [s] the store is asked for: a watch remembers deletions no longer, and its host's
clock may be wrong."""


class Judges:
    """Those of what the watches of one session hear, whose link goes to `router`."""

    def __init__(
        self, authority: Authority, realm: str, router: RouterPresence, trace: Trace
    ) -> None:
        self.authority, self.realm = authority, realm
        self._router, self._trace = router, trace
        self._informed = 0
        """The generation of the link in which a store was asked last what is revoked."""

    def informs(self, generation: int) -> None:
        """A store has said which certificates are revoked, on that generation of the link."""
        self._informed = generation

    @property
    def listened_s(self) -> float:
        """For how long this session has heard all that passes, and knows what is revoked [s]."""
        return self._router.age_s if self._informed == self._router.generation else 0.0

    def new(self) -> LiveSignatures:
        """One for what one watch hears of a key."""
        return LiveSignatures(self)

    def pattern(self) -> str:
        """What a watch watches besides, to hear which certificates are revoked."""
        self._trace.note("watch", REVOCATIONS, REVOCATIONS.pattern())
        return REVOCATIONS.pattern()

    def learn(self, address: AuthorityAddress, value: Revocations | None) -> None:
        """What is revoked by a list that the store has, or that was judged."""
        if value is not None:
            self.authority.revoked.objection(address, value)


class LiveSignatures:
    """The judge of one watch's values of a key."""

    def __init__(self, judges: Judges) -> None:
        self._judges = judges
        self._began_s = time.monotonic()
        self._heard = Heard(REMEMBERED_S)

    def judge(self, sample: Sample) -> Judged:
        """By whom a value or a deletion is, and why it is not taken in, if it is not. With
        wildcards nothing is: the store says what is gone."""
        if "*" in sample.keyexpr:
            return Judged()
        whole = replace(sample, keyexpr=f"{self._judges.realm}/{sample.keyexpr}")
        attachment = Attachment.read(sample.attached)
        return self._judges.authority.judge(whole, sample.stamp, attachment, deleted=sample.deleted)

    def is_news(self, key: Key[Any, Any], sample: Sample, by: str) -> bool | None:
        """Whether what somebody has signed was not said before; None: it may have been, before
        anybody listened here or knew what is revoked, and the store knows."""
        if not is_signed(key) or "*" in sample.keyexpr or (key is STOP and not sample.deleted):
            return True
        if self._heard.before(by, sample.keyexpr, sample.stamp):
            return False
        began_s = time.monotonic() - self._began_s
        listened_s = min(REMEMBERED_S, self._judges.listened_s, began_s)
        if not listened_s or time.time() - time_s_of_stamp(sample.stamp) > listened_s:
            return None
        self._heard.begin()
        self._heard.note(by, sample.keyexpr, sample.stamp)
        return True
