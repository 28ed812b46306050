"""A session that does not close in time is a line in the log, and no traceback at the end."""

from __future__ import annotations

import zenoh

from keyexpr_schema.transport.closing import close_session


class Flooded:
    """A session whose link is full for good."""

    def close(self) -> None:
        """As Zenoh's own, after 10 s."""
        raise zenoh.ZError("close operation timed out!")


def test_a_session_that_does_not_close_in_time_ends_nothing_else(caplog):
    close_session(Flooded())
    assert caplog.messages == ["a session did not close as it should: close operation timed out!"]
