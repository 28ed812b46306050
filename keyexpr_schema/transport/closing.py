"""Closing Zenoh sessions, whatever their links are at."""

from __future__ import annotations

import logging

import zenoh

_log = logging.getLogger(__name__)


def close_session(session: zenoh.Session) -> None:
    """Close it; blocks for a moment. What was sent before goes out first.

    Zenoh gives up after 10 s, as when somebody floods a link of it: that is logged, for whoever
    ends has nothing else to do about it.
    """
    try:
        session.close()  # type: ignore[no-untyped-call]
    except zenoh.ZError as error:
        _log.warning("a session did not close as it should: %s", error)
