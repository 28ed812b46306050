"""The audit log: who did what, once, in a file that only grows."""

from __future__ import annotations

import resource
from pathlib import Path

import pytest
from msgspec.structs import replace

from fleet.errors import StoreError
from fleet.history.audit_log import FILE, AuditLog
from keyexpr_schema.payloads.audit import AuditAction, AuditEntry, AuditQuery


def entry(number: int, **more: object) -> AuditEntry:
    known = AuditEntry(
        at="2026-11-29T12:00:00.000+00:00",
        wall_time_s=1000.0 + number,
        time_s=float(number),
        by="ana@lab" if number % 2 else "bob@hall",
        action=AuditAction.PUT,
        key=f"goals/g{number}/spec",
        summary=f"goal g{number}: “Bring cup {number} to the hallway.”",
        digest=f"{number:x}",
    )
    return replace(known, **more)


def test_what_was_said_stands_once_however_often_it_is_heard_of(tmp_path: Path) -> None:
    with AuditLog(tmp_path) as log:
        assert log.add(entry(1)) and log.add(entry(2))
        assert not log.add(entry(1)), "replayed by a planner that starts"
        assert not log.add(entry(2, wall_time_s=9e9)), "heard again of a key that says the same"
    with AuditLog(tmp_path) as log:
        before = (tmp_path / FILE).read_bytes()
        assert not log.add(entry(1))
        deleted = entry(1, wall_time_s=2000.0, action=AuditAction.DELETED, digest="")
        assert log.add(deleted)
        assert not log.add(replace(deleted, wall_time_s=2001.0))
        assert log.add(entry(1, wall_time_s=2002.0)), "said once more after it was deleted"
        assert (tmp_path / FILE).read_bytes().startswith(before)
        assert [e.wall_time_s for e in log.page(AuditQuery()).entries] == [
            2002.0, 2000.0, 1002.0, 1001.0,
        ]  # fmt: skip


def test_it_is_asked_by_whom_since_when_and_about_what(tmp_path: Path) -> None:
    with AuditLog(tmp_path) as log:
        for number in range(1, 2001):  # more than one block of the file
            log.add(entry(number))
        page = log.page(AuditQuery(limit=3))
        assert [e.wall_time_s for e in page.entries] == [3000.0, 2999.0, 2998.0] and page.more
        late = log.page(AuditQuery(since_wall_s=2990.0, by="ANA"))
        assert [e.wall_time_s for e in late.entries] == [2999.0, 2997.0, 2995.0, 2993.0, 2991.0]
        assert not late.more
        assert [e.by for e in log.page(AuditQuery(about="g7")).entries] == ["ana@lab"]
        assert len(log.page(AuditQuery(limit=10_000)).entries) == 2000
        assert log.page(AuditQuery(by="eve")).entries == ()


def test_a_line_torn_by_a_power_cut_loses_nothing_else(tmp_path: Path) -> None:
    with AuditLog(tmp_path) as log:
        log.add(entry(1))
    with (tmp_path / FILE).open("ab") as file:
        file.write(b'{"at":"2026-11-29T12:00')
    with AuditLog(tmp_path) as log:
        assert log.add(entry(2))
        assert [e.time_s for e in log.page(AuditQuery()).entries] == [2.0, 1.0]


def test_what_the_disk_has_no_room_for_is_written_when_it_has(tmp_path: Path) -> None:
    with AuditLog(tmp_path) as log:
        log.add(entry(1))
        room = (tmp_path / FILE).stat().st_size + 20
        limits = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (room, limits[1]))
        try:
            assert log.add(entry(2)) and log.add(entry(3))
            assert [e.time_s for e in log.page(AuditQuery()).entries] == [1.0]
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        log.sync()
        assert [e.time_s for e in log.page(AuditQuery()).entries] == [3.0, 2.0, 1.0]


def test_a_folder_in_its_place_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / FILE).mkdir()
    with pytest.raises(StoreError, match=r"audit\.jsonl cannot be used: it is a folder"):
        AuditLog(tmp_path).__enter__()
