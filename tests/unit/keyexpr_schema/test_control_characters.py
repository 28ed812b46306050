"""Control characters in what others wrote reach no log."""

from __future__ import annotations

import logging

import pytest

from keyexpr_schema.control_characters import show_in_logs


def test_log_lines_show_them(caplog: pytest.LogCaptureFixture) -> None:
    before = logging.getLogRecordFactory()
    try:
        show_in_logs()
        logging.getLogger("test").warning("robot %s says\n%s", "r\x1b[2J", "\x07")
    finally:
        logging.setLogRecordFactory(before)
    assert caplog.messages == ["robot r\\x1b[2J says\n\\x07"]
