"""Configuration files by path or name: a person's own first, then those that are shipped."""

from __future__ import annotations

from pathlib import Path

import pytest

from keyexpr_schema.config_files import SHIPPED, config_file
from keyexpr_schema.errors import NoConfigFile


def put(path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("")
    return path


def test_a_name_is_the_working_folders_file_or_a_shipped_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert config_file("missions", "two-cups") == SHIPPED / "missions" / "two-cups.yaml"
    own = put(tmp_path / "configs" / "missions" / "two-cups.yaml")
    assert config_file("missions", "two-cups").resolve() == own


def test_a_name_in_a_file_is_first_looked_for_beside_that_files_folder(tmp_path: Path) -> None:
    mission = put(tmp_path / "missions" / "mine.yaml")
    shipped = SHIPPED / "robots" / "hsr.yaml"
    assert config_file("robots", "hsr", mission).resolve() == shipped
    own = put(tmp_path / "robots" / "hsr.yaml")
    assert config_file("robots", "hsr", mission) == own


def test_a_path_is_as_given_or_relative_to_the_file_that_names_it(tmp_path: Path) -> None:
    assert config_file("robots", "mine/hsr.yaml") == Path("mine/hsr.yaml")
    assert config_file("robots", "hsr.yaml", tmp_path / "m.yaml") == tmp_path / "hsr.yaml"


def test_a_name_of_no_file_is_told_those_there_are_and_where_they_were_looked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    put(tmp_path / "configs" / "robots" / "porter.yaml")
    put(tmp_path / "configs" / "robots" / "porter.model.yaml")
    with pytest.raises(NoConfigFile) as caught:
        config_file("robots", "forklift")
    with pytest.raises(NoConfigFile, match="there is no robot"):
        config_file("robots", "x" * 3000)
    assert str(caught.value) == (
        "there is no robot 'forklift'; there are bench_arm, butler, cart, hsr, locobot, porter "
        f"(looked in configs/robots, {SHIPPED / 'robots'}), or give the path of a file"
    )


def test_a_file_of_another_kind_right_here_is_a_path_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    put(tmp_path / "README.md")
    put(tmp_path / "hsr")
    assert config_file("robots", "README.md") == Path("README.md")
    assert config_file("robots", "hsr") == SHIPPED / "robots" / "hsr.yaml"


def test_a_folder_that_is_the_shipped_one_is_told_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(SHIPPED.parent)
    with pytest.raises(NoConfigFile, match=r"\(looked in configs/robots\), or give"):
        config_file("robots", "forklift")
