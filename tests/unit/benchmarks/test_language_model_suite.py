"""The suite of sentences with a language model: a scripted server at the end of the real calls."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest

from benchmarks.language import run
from benchmarks.language.entries import load_suite
from benchmarks.language.model import ModelReader, model_rows
from benchmarks.language.reader import Read, Refused, answer
from benchmarks.language.report import Result
from benchmarks.language.verdict import judge
from fleet.llm import LanguageModel, LlmConfig
from fleet.llm.client import ModelClient
from fleet.llm.prompts import PROMPTS_DIR
from tests.support.llm_server import LlmServer, Reply

CANDLE = "Zorgle the candle, mate."


def test_what_the_grammar_refuses_is_read_as_the_model_says_it(model_client: ModelClient) -> None:
    replies = [
        Reply({"sentences": ["Where is the candle?"], "reason": ""}),
        Reply({"sentences": [], "reason": "nobody knows"}, tokens=(70, 7)),
    ]
    with LlmServer(*replies) as server:
        config = LlmConfig(
            model="openai/scripted",
            api_base=server.api_base,
            usd_per_million_tokens_in=1.0,
            usd_per_million_tokens_out=2.0,
        )
        reader = ModelReader(LanguageModel(config, model_client))
        assert reader.answer(CANDLE, "house") == answer("Where is the candle?", "house")
        assert isinstance(reader.answer("Zorgle it.", "house"), Refused)
        assert reader.answer("Zorgle it.", "house") == answer("Zorgle it.", "house")
        assert isinstance(reader.answer("Go to the kitchen.", "apartment"), Read)
    assert len(server.requests) == 2
    first, second = reader.asked.values()
    assert (first.said, first.rounds, first.tokens_in) == ("Where is the candle?", 1, 100)
    assert first.usd == pytest.approx(200e-6)
    assert (second.said, second.why) == (None, "the language model says: nobody knows")
    sentence = next(s for s in load_suite("dev") if s.entry.world == "house")
    found = reader.answer(CANDLE, "house")
    result = Result(sentence, found, judge(sentence.entry, found, lambda text: found), 0.1)
    entry = sentence.entry
    (row, everything) = model_rows([result], {(entry.world, entry.say): first})
    assert row[:3] == (sentence.kind, "1", "0")
    assert row[-6:-2] == ("1", "100", "50", "0.0002")
    assert everything[1:] == row[1:]


def test_it_runs_from_the_command_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    def reply(request: dict[str, Any]) -> Reply:
        return Reply({"sentences": [], "reason": "I was only asked for a test"})

    with LlmServer(reply) as server:
        few = ["--only", "dev", "--kind", "vague", "--world", "warehouse"]
        model = ["--model", "openai/scripted", "--api-base", server.api_base]
        out = tmp_path / "page.md"
        monkeypatch.setattr(sys, "argv", ["run", *few, *model, "--out", str(out)])
        assert run.main() == 0
    said = capsys.readouterr().out
    assert "language.confirm" in said
    assert "By kind" in out.read_text()
    assert "tokens in" in out.read_text()
    assert all(request["model"] == "scripted" for request in server.requests)


def test_what_is_wrong_with_the_model_is_said_in_a_sentence(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["run", "--model", "openai/x", "--api-base", "localhost"])
    assert run.main() == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_the_sentences_that_models_are_shown_are_read() -> None:
    """In a world that has what they speak of: taken, or asked about."""
    shown = (PROMPTS_DIR / "v1" / "paraphrase-system.txt").read_text(encoding="utf-8")
    rows = [line[2:] for line in shown.splitlines() if line.startswith("- ")]
    sentences = [f"{each}." for row in rows for each in row.removesuffix(".").split(". ")]
    refused = {
        each: found.sentence
        for each in sentences
        if isinstance(found := answer(each, "house"), Refused)
    }
    assert len(sentences) > 20
    assert refused == {}
