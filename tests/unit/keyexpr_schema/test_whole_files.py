"""Files that people edit are written whole or not at all."""

from __future__ import annotations

import errno
from pathlib import Path

import pytest

from keyexpr_schema.whole_files import write_whole
from tests.support.full_disk import no_room


def test_a_file_without_room_is_as_it_was_and_nothing_is_left_beside_it(tmp_path: Path) -> None:
    path, link = tmp_path / "mine.yaml", tmp_path / "link.yaml"
    write_whole(path, b"before")
    path.chmod(0o640)
    link.symlink_to(path)
    for there in (path, link, tmp_path / "new.yaml"):
        with no_room(), pytest.raises(OSError) as refused:
            write_whole(there, b"after")
        assert (refused.value.errno, refused.value.filename) == (errno.EFBIG, str(there))
    assert sorted(tmp_path.iterdir()) == [link, path]
    assert path.read_bytes() == b"before"
    write_whole(link, b"after")
    assert link.is_symlink() and path.read_bytes() == b"after"
    assert path.stat().st_mode & 0o777 == 0o640
