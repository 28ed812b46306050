"""The `language` section of a planner configuration."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

from fleet.errors import BadLanguageConfig
from fleet.language import Confirm, LanguageConfig, load_language_config
from fleet.llm import load_llm_config
from keyexpr_schema.config_files import SHIPPED


def test_the_shipped_file_has_every_field_as_it_is_by_default() -> None:
    path = SHIPPED / "planner.yaml"
    assert load_language_config(path) == LanguageConfig() == load_language_config()
    assert LanguageConfig().confirm is Confirm.ALWAYS
    for field in msgspec.structs.fields(LanguageConfig):
        assert f"  {field.name}:" in path.read_text(encoding="utf-8")


@pytest.mark.parametrize("text", ["llm: {model: openai/x}", "language: {confirm: always}"])
def test_each_section_may_be_left_out(tmp_path: Path, text: str) -> None:
    path = tmp_path / "planner.yaml"
    path.write_text(text)
    assert load_language_config(path) == LanguageConfig()
    assert load_llm_config(path).model in (None, "openai/x")


def test_what_is_written_is_read(tmp_path: Path) -> None:
    path = tmp_path / "planner.yaml"
    path.write_text("llm: {model: openai/x}\nlanguage: {confirm: coarse}\n")
    assert load_language_config(path).confirm is Confirm.COARSE
    assert load_llm_config(path).model == "openai/x"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "language: {confirm: maybe}",
            "language.confirm: invalid enum value 'maybe'; it is one of always",
        ),
        (
            "language: {confirm: true}",
            "confirm: expected text, got true or false; it is one of always, coarse, never",
        ),
        (
            "language: {confirmed: always}",
            "language.confirmed: there is no such field; valid are: confirm",
        ),
        ("language: always", "language: a section is a list of `name: value` lines"),
        ("speech: {}", "sections `llm` and `language`"),
        ("", "sections `llm` and `language`"),
        ("language: [", "is not YAML"),
    ],
)
def test_what_is_wrong_is_said_in_a_sentence(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "planner.yaml"
    path.write_text(text)
    with pytest.raises(BadLanguageConfig) as raised:
        load_language_config(path)
    assert str(path) in str(raised.value)
    assert words in str(raised.value)
    assert "\n" not in str(raised.value)
