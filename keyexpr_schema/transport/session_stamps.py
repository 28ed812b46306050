"""The clock by which a session stamps what it writes, and how it comes back from the future.

Zenoh's hybrid logical clock (Kulkarni et al., 2014) never goes back: a session that has stamped
while the clock of its host was ahead goes on there, and what it writes is not taken in until that
time has come. So once the host's clock is right again, its stamps begin anew, at the time it is and
as those of somebody else: should anything that it wrote before be stored with a later stamp, it
hears that it is overtaken, as it would if it had been started again.
"""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable

import zenoh

from keyexpr_schema.transport.stamps import source_of_stamp, stamp_of_text, time_s_of_stamp

_NS = 1_000_000_000
_SOURCE_BYTES = 16


class SessionStamps:
    """The timestamps of `session`; to be used on one thread."""

    def __init__(self, session: zenoh.Session, now_ns: Callable[[], int] = time.time_ns) -> None:
        self._session, self._now_ns = session, now_ns
        self._source, self._latest_ns = b"", 0
        self.begun = 0
        """How often they have begun anew."""
        self._known_as = self._source_now()

    def _source_now(self) -> int:
        return source_of_stamp(stamp_of_text(str(self.new())))

    def made(self, stamp: int) -> bool:
        """Whether a stamp is one of these, and not from before they have begun anew."""
        return source_of_stamp(stamp) == self._known_as

    def new(self) -> zenoh.Timestamp:
        """A timestamp that is later than all before it, unless it has begun anew."""
        if not self.begun:
            return self._session.new_timestamp()
        self._latest_ns = max(self._now_ns(), self._latest_ns + 1)
        return zenoh.Timestamp(zenoh.NTP64(*divmod(self._latest_ns, _NS)), self._source)

    def now_s(self) -> float:
        """The time of a stamp that is made now [s, Unix]; it is not set back with the host's."""
        return time_s_of_stamp(stamp_of_text(str(self.new())))

    def begin_anew(self, at_least_s: float) -> None:
        """Stamp by the host's clock again, and not before `at_least_s` [s, Unix]."""
        self._source, self._latest_ns = secrets.token_bytes(_SOURCE_BYTES), round(at_least_s * _NS)
        self.begun += 1
        self._known_as = self._source_now()
