"""Files that people edit are written whole or not at all."""

from __future__ import annotations

import errno
from pathlib import Path

import pytest

from keyexpr_schema.whole_files import beside_of, write_whole
from tests.support.full_disk import no_room
from tests.support.power_cut import cut, was_synced


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


WRITES = """
import sys
from pathlib import Path
from cli.certificates.authority import Authority
from cli.certificates.identity import Identity
from keyexpr_schema.whole_files import make_folder, write_whole
folder = Path(sys.argv[1])
office = Authority.create(folder / "certs" / "home", "home")
office.issue(Identity.parse("router"))
office.issue(Identity.parse("operator.ana"))
make_folder(folder / "configs" / "worlds")
write_whole(folder / "configs" / "worlds" / "home.yaml", b"world: home")
"""


def test_what_was_said_to_be_written_is_there_after_a_power_cut(tmp_path: Path) -> None:
    folder = cut(tmp_path, WRITES)
    written = {path.relative_to(folder): path for path in folder.rglob("*") if path.is_file()}
    names = ["ca.key", "ca.pem", "issued.json"]
    names += [f"{who}.{end}" for who in ("operator-ana", "router-main") for end in ENDS]
    assert sorted(map(str, written)) == [
        *(f"certs/home/{name}" for name in sorted(names)),
        "configs/worlds/home.yaml",
    ]
    for path in written.values():
        assert was_synced(tmp_path, beside_of(path)) == path.read_bytes()


ENDS = ("json5", "key", "pem")
