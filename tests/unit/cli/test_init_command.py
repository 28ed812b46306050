"""`robotctl init`: what is there stays, what is missing comes, and it is what robotctl reads."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from cli.commands.init import init
from sim.files.mission_file import load_mission
from tests.support.full_disk import no_room


def run(*arguments: str) -> str:
    done = CliRunner().invoke(init, list(arguments), catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.stdout


def test_configuration_to_edit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mine = tmp_path / "configs" / "missions" / "two-cups.yaml"
    mine.parent.mkdir(parents=True)
    mine.write_text("mine")
    told = json.loads(run(str(tmp_path), "--json"))
    assert told["kept"] == [str(mine)]
    assert mine.read_text() == "mine"
    assert not (tmp_path / "configs" / "skills").exists()
    assert (tmp_path / "robotctl.yaml").is_file()

    monkeypatch.chdir(tmp_path)
    assert load_mission("find-cup").mission == "find-cup"
    again = run("--all")
    assert "next: edit configs/missions/two-cups.yaml, then `robotctl up two-cups`" in again
    assert (tmp_path / "configs" / "skills" / "household.yaml").is_file()
    assert mine.read_text() == "mine"


def test_what_is_written_to_configs_is_counted_without_what_lies_beside_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    told = run().splitlines()[0]
    files = sum(path.is_file() for path in (tmp_path / "configs").rglob("*"))
    assert told == f"wrote {files} files to configs, and robotctl.yaml"
    assert run().splitlines()[0] == "wrote 0 files to configs"


def test_what_there_was_no_room_for_comes_the_next_time(tmp_path: Path) -> None:
    """No half of a file is left that would be taken for somebody's own."""
    with no_room():
        done = CliRunner().invoke(init, [str(tmp_path)])
    assert done.exit_code == 1
    assert re.search(rf"Error: {tmp_path}/\S+ cannot be used: File too large", done.output)
    assert json.loads(run(str(tmp_path), "--json"))["kept"] == []
