"""The suite with a language model, which is asked about what the grammar refuses."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from statistics import median

from benchmarks.language.entries import KINDS
from benchmarks.language.reader import Answer, Refused, answer, vocabulary_of
from benchmarks.language.report import Result, Row
from benchmarks.language.verdict import Verdict
from benchmarks.language.worlds import NOW
from fleet.language import Reading
from fleet.llm import LanguageModel
from fleet.planners import LlmParaphraser

MODEL_HEAD = (
    "with the model", "asked", "no words", *(verdict.value for verdict in Verdict), "rounds",
    "tokens in", "tokens out", "USD", "median", "worst",
)  # fmt: skip


@dataclass(frozen=True)
class Asked:
    """What became of a sentence that the model was asked about, and what it took.

    `said` is the paraphrase, `why` why there is none; `usd` is `None` where no price is known.
    """

    said: str | None
    why: str
    rounds: int
    tokens_in: int
    tokens_out: int
    usd: float | None
    wall_s: float


@dataclass
class ModelReader:
    """Reads as the product does: what the grammar refuses is read as the model says it."""

    model: LanguageModel
    asked: dict[tuple[str, str], Asked] = field(default_factory=dict)
    """By world and text."""

    def answer(self, text: str, world: str) -> Answer:
        """What is made of a text; of a paraphrase, what a person would be asked to confirm."""
        found = answer(text, world)
        if not isinstance(found, Refused):
            return found
        asked = self.asked.get((world, text))
        if asked is None:
            asked = self.asked[world, text] = self._ask(text, world, found.sentence)
        return found if asked.said is None else answer(asked.said, world)

    def _ask(self, text: str, world: str, refusal: str) -> Asked:
        budget = self.model.budget()
        began_s = time.perf_counter()
        said = LlmParaphraser(self.model).paraphrase(
            text, refusal, vocabulary_of(world), NOW, check=_anything, budget=budget
        )
        took_s = time.perf_counter() - began_s
        making = budget.making("paraphraser")
        return Asked(
            None if isinstance(said, str) else said.text,
            said if isinstance(said, str) else "",
            making.rounds,
            making.tokens_in,
            making.tokens_out,
            making.cost_usd,
            took_s,
        )


def _anything(reading: Reading) -> None:
    """Whatever can be read is a paraphrase: the suite has questions and statements, too."""


def model_rows(results: Sequence[Result], asked: dict[tuple[str, str], Asked]) -> list[Row]:
    """By kind, what became of the sentences that the model was asked about, and what it took."""
    rows = [
        (result, asked[key])
        for result in results
        if (key := (result.sentence.entry.world, result.sentence.entry.say)) in asked
    ]
    groups = [(kind, [row for row in rows if row[0].sentence.kind == kind]) for kind in KINDS]
    return [_row(name, some) for name, some in [*groups, ("all", rows)] if some]


def _row(name: str, rows: Sequence[tuple[Result, Asked]]) -> Row:
    calls = [asked for _, asked in rows]
    priced = [asked.usd for asked in calls if asked.usd is not None]
    counts = [
        sum(asked.said is not None and result.verdict is verdict for result, asked in rows)
        for verdict in Verdict
    ]
    return (
        name,
        str(len(rows)),
        str(sum(asked.said is None for asked in calls)),
        *map(str, counts),
        str(sum(asked.rounds for asked in calls)),
        str(sum(asked.tokens_in for asked in calls)),
        str(sum(asked.tokens_out for asked in calls)),
        f"{sum(priced):.4f}" if priced else "unknown",
        f"{median(asked.wall_s for asked in calls):.2f} s",
        f"{max(asked.wall_s for asked in calls):.2f} s",
    )
