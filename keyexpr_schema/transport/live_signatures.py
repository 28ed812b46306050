"""What passes on a link, judged before it is believed, by who knows an authority.

What a store of ours says was judged when it came in. What passes was not: it may be forged, or said
again by somebody who has heard it.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from keyexpr_schema.authors import is_signed
from keyexpr_schema.key import Key
from keyexpr_schema.keyspace import STOP
from keyexpr_schema.transport.attachments import Attachment
from keyexpr_schema.transport.heard import Heard
from keyexpr_schema.transport.samples import Sample
from keyexpr_schema.transport.signatures import Authority, Judged
from keyexpr_schema.transport.stamps import time_s_of_stamp

REMEMBERED_S = 60.0
"""What is older [s] the store is asked for: a watch remembers deletions no longer, and its host's
clock may be wrong."""


class LiveSignatures:
    """The judge of one watch's values of `key`; `linked_s` says for how long the link is up [s]."""

    def __init__(self, authority: Authority, realm: str, linked_s: Callable[[], float]) -> None:
        self._authority, self._realm, self._linked_s = authority, realm, linked_s
        self._began_s = time.monotonic()
        self._heard = Heard(REMEMBERED_S)

    def judge(self, sample: Sample) -> Judged:
        """By whom a value or a deletion is, and why it is not taken in, if it is not. With
        wildcards nothing is: the store says what is gone."""
        if "*" in sample.keyexpr:
            return Judged()
        whole = replace(sample, keyexpr=f"{self._realm}/{sample.keyexpr}")
        attachment = Attachment.read(sample.attached)
        return self._authority.judge(whole, sample.stamp, attachment, deleted=sample.deleted)

    def is_news(self, key: Key[Any, Any], sample: Sample, by: str) -> bool | None:
        """Whether what somebody has signed was not said before; None: it may have been, before
        anybody listened here, and the store knows."""
        if not is_signed(key) or "*" in sample.keyexpr or (key is STOP and not sample.deleted):
            return True
        if self._heard.before(by, sample.keyexpr, sample.stamp):
            return False
        listened_s = min(REMEMBERED_S, self._linked_s(), time.monotonic() - self._began_s)
        if time.time() - time_s_of_stamp(sample.stamp) > listened_s:
            return None
        self._heard.begin()
        self._heard.note(by, sample.keyexpr, sample.stamp)
        return True
