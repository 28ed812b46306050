"""Configuration of the language model, and its prompts."""

from __future__ import annotations

from pathlib import Path
from string import Template

import msgspec
import pytest

from fleet.errors import BadLlmConfig
from fleet.llm.configuration import LlmConfig, load_llm_config
from fleet.llm.prompts import PROMPTS_DIR, load_prompts
from fleet.planners.llm.answers import StepAnswer, TaskAnswer
from keyexpr_schema.payloads.plans import Task

ROOT = Path(__file__).parents[3]


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def test_the_shipped_file_has_no_model_and_every_field() -> None:
    path = ROOT / "configs" / "planner.yaml"
    assert load_llm_config(path) == LlmConfig()
    for field in msgspec.structs.fields(LlmConfig):
        assert f"  {field.name}:" in path.read_text(encoding="utf-8")


def test_the_shipped_file_is_found_from_anywhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert load_llm_config().model is None
    (tmp_path / "configs").mkdir()
    write(tmp_path / "configs" / "planner.yaml", "llm: {model: openai/mine}")
    assert load_llm_config().model == "openai/mine"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "llm: {modell: x}",
            "line 1: llm.modell: there is no such field; valid are: model, api_base",
        ),
        ("llm: {timeout_s: soon}", "llm.timeout_s: expected a number, got text 'soon'"),
        ("llm: {timeout_s: 0}", "llm.timeout_s: expected a number greater than 0.0, got 0"),
        (
            "llm: {max_repairs: -1}",
            "llm.max_repairs: expected a whole number of at least 0, got -1",
        ),
        (
            "llm: {structured: maybe}",
            "llm.structured: invalid enum value 'maybe'; it is one of auto, schema, plain",
        ),
        ("llm: {model: ''}", "`model` is empty"),
        ("llm: {api_base: localhost}", "must start with http"),
        ("llm: {usd_per_million_tokens_in: 1}", "prices come in pairs"),
        ("llm: {options: {messages: []}}", "must not name messages"),
        ("llm: [", "is not YAML"),
        ("other: {}", "sections `llm` and `language`"),
        ("- llm", "sections `llm` and `language`"),
        ("llm: {1: 2}", "llm.1: there is no such field"),
    ],
)
def test_what_is_wrong_is_said_in_a_sentence(tmp_path: Path, text: str, words: str) -> None:
    path = write(tmp_path / "planner.yaml", text)
    with pytest.raises(BadLlmConfig) as raised:
        load_llm_config(path)
    assert str(path) in str(raised.value)
    assert words in str(raised.value)
    assert "\n" not in str(raised.value)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(BadLlmConfig, match="cannot be read"):
        load_llm_config(tmp_path / "none.yaml")


def test_rules_replace_prompts_of_the_same_name(tmp_path: Path) -> None:
    (tmp_path / "rules").mkdir()
    write(tmp_path / "rules" / "house-rules.txt", "Cups cost $$5 each.")
    path = write(tmp_path / "planner.yaml", "llm: {rules_dir: rules}")
    config = load_llm_config(path)
    prompts = load_prompts(config)
    assert prompts.version.startswith("v1+rules-")
    for system in ("system", "paraphrase-system", "allocate-system"):
        assert prompts.fill(system).endswith("Cups cost $5 each.")
    plain = load_prompts(LlmConfig())
    assert plain.version == "v1"
    assert "Cups" not in plain.fill("system")
    write(tmp_path / "rules" / "house-rules.txt", "Other rules.")
    assert load_prompts(config).version != prompts.version


def test_the_example_rules_fit() -> None:
    config = LlmConfig(rules_dir=str(ROOT / "configs" / "rules"))
    assert "Rules of this house" in load_prompts(config).fill("system")


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("sistem.txt", "", "replaces no prompt; those are allocate.txt"),
        ("repair.txt", "$problem", "placeholders are $details, $house_rules, $violations"),
        ("system.txt", "costs $ 5", "write $$ for a dollar sign"),
        ("system.txt", "x" * 20_001, "20000 are allowed"),
    ],
)
def test_rules_that_do_not_fit_are_refused(
    tmp_path: Path, name: str, text: str, words: str
) -> None:
    write(tmp_path / name, text)
    with pytest.raises(BadLlmConfig) as raised:
        load_prompts(LlmConfig(rules_dir=str(tmp_path)))
    assert words in str(raised.value)


def test_no_rules_folder_and_no_such_version(tmp_path: Path) -> None:
    with pytest.raises(BadLlmConfig, match="does not exist"):
        load_prompts(LlmConfig(rules_dir=str(tmp_path / "none")))
    with pytest.raises(BadLlmConfig, match="there are v1"):
        load_prompts(LlmConfig(prompts="../v1"))


def test_values_in_a_prompt_are_not_expanded() -> None:
    filled = load_prompts(LlmConfig()).fill("repair", violations="$details", details="secret")
    assert filled.count("secret") == 1


def test_every_prompt_has_only_placeholders_that_are_filled() -> None:
    filled = {"skills", "problem", "form", "frames", "violations", "details", "house_rules"} | {
        "stubs"
    }
    for path in PROMPTS_DIR.glob("*/*.txt"):
        assert set(Template(path.read_text(encoding="utf-8")).get_identifiers()) <= filled, path


def test_answers_have_the_types_of_tasks() -> None:
    """What a model may say of a task is what a task is."""
    types = {field.name: field.type for field in msgspec.structs.fields(Task)}
    for answer in (StepAnswer, TaskAnswer):
        for field in msgspec.structs.fields(answer):
            assert field.type == types[field.name]
