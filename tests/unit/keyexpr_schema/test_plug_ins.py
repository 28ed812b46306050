"""Plug-ins: a broken one costs a warning that names it, and no other is missed."""

from __future__ import annotations

from pathlib import Path

import pytest

from keyexpr_schema.errors import BrokenPlugIn
from keyexpr_schema.plug_ins import load_plug_in, load_plug_ins, plug_in_names

GROUP = "robotfleet.test_group"


def even(offered: object) -> int:
    if not isinstance(offered, int) or offered % 2:
        raise TypeError(f"{offered!r} is not an even number")
    return offered


@pytest.fixture
def theirs(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An installed package with good and bad entry points."""
    site = tmp_path_factory.mktemp("site")
    (site / "their_numbers.py").write_text("two, three, four = 2, 3, 4\n")
    (site / "their_broken.py").write_text("raise OSError('no such device')\n")
    (site / "their_script.py").write_text("import sys\nsys.exit('usage: their_script FILE')\n")
    info = site / "their_numbers-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: their-numbers\nVersion: 1\n")
    (info / "entry_points.txt").write_text(
        f"[{GROUP}]\ntwo = their_numbers:two\nthree = their_numbers:three\n"
        "none = their_numbers:nothere\nscript = their_script:x\n"
        "broken = their_broken:x\nfour = their_numbers:four\n"
    )
    monkeypatch.syspath_prepend(site)
    return site


def test_broken_ones_are_named_and_the_others_loaded(
    theirs: Path, caplog: pytest.LogCaptureFixture
) -> None:
    assert load_plug_ins(GROUP, even) == [2, 4]
    three, nothere, script, broken = (record.getMessage() for record in caplog.records)
    assert three == (
        "package their-numbers offers their_numbers:three as 'three' in robotfleet.test_group, "
        "which cannot be used: TypeError: 3 is not an even number"
    )
    assert "their_numbers:nothere as 'none'" in nothere and "AttributeError" in nothere
    assert script.endswith("SystemExit: usage: their_script FILE")
    assert broken.endswith("OSError: no such device")


def test_one_is_asked_for_by_name_and_must_be_sound(theirs: Path) -> None:
    assert plug_in_names(GROUP) == ("broken", "four", "none", "script", "three", "two")
    assert load_plug_in(GROUP, "two", even) == 2
    with pytest.raises(BrokenPlugIn, match=r"package their-numbers .* 3 is not an even number"):
        load_plug_in(GROUP, "three", even)
    with pytest.raises(BrokenPlugIn, match=r"no installed package offers 'five' in .*broken, four"):
        load_plug_in(GROUP, "five", even)
    with pytest.raises(BrokenPlugIn, match="there are none"):
        load_plug_in("robotfleet.nobody", "five", even)
