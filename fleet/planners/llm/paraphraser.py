"""Sentences that the grammar refuses, said by a language model in others that it reads."""

from __future__ import annotations

import logging
from collections.abc import Callable
from datetime import datetime
from typing import NamedTuple

import msgspec

from fleet.core.model.world import WorldModel
from fleet.core.understanding import wanted_goals
from fleet.errors import NotUnderstood
from fleet.language import Ambiguity, Reading, Vocabulary, read
from fleet.language.methods.model import CompoundTask
from fleet.llm.budget import Budget
from fleet.llm.conversation import GivenUp, LanguageModel, Rejected
from fleet.llm.quoting import cleaned, printable
from fleet.llm.structured_output import StructuredAnswer, read_answer, schema_of
from fleet.planners.base import Planner
from fleet.planners.llm.method_proposals import ProposalRefused, TaskAnswer, checked_task
from fleet.planners.llm.prompt_text import frames_text, sentence_text

log = logging.getLogger(__name__)

MOST_SENTENCES = 20
MOST_CHARACTERS = 2_000


class ParaphraseAnswer(StructuredAnswer, frozen=True):
    """Sentences, or why there are none; `task` may teach the fleet what the sentence means."""

    sentences: tuple[str, ...]
    task: TaskAnswer | None = None
    reason: str = ""


class Paraphrase(msgspec.Struct, frozen=True):
    """What a sentence means in others, which the grammar reads, and a task that it could call."""

    text: str
    task: CompoundTask | None = None


class LlmParaphraser:
    """Says sentences in words that the grammar reads; asks within the budget of one plan.

    The model never says what is to be done, only how the sentence can be said; so it can say
    nothing that a person could not.
    """

    def __init__(self, model: LanguageModel, planner: Planner | None = None) -> None:
        """`planner` sees whether tasks that the model proposes can be done; without it there are
        none."""
        self._model = model
        self._planner = planner

    @property
    def waiting_s(self) -> float:
        """How long an answer takes at most, s."""
        return self._model.longest_s

    def paraphrase(
        self,
        sentence: str,
        refusal: str,
        vocabulary: Vocabulary,
        now: datetime | None = None,
        *,
        world: WorldModel | None = None,
        check: Callable[[Reading], object] = wanted_goals,
        budget: Budget | None = None,
    ) -> Paraphrase | str:
        """The sentence in others that are read, as a goal, or a sentence that says why not.

        `refusal` is why the grammar does not take it, `now` what the clock says; `check` raises
        `NotUnderstood` for a reading that is none of what is wanted. What is not understood of an
        answer goes back with the reason, as often as the configuration allows. A task that the
        model proposes besides comes along if it can be done in the `world`. Blocks, and never
        raises.
        """
        said: _Said | str | GivenUp = self._model.ask(
            system="paraphrase-system",
            question="paraphrase",
            correction="paraphrase-repair",
            values={
                "frames": frames_text(vocabulary),
                "problem": sentence_text(sentence, refusal, vocabulary),
                "form": _FORM,
            },
            schema=schema_of(ParaphraseAnswer),
            read=lambda text: _read(text, vocabulary, now, check),
            budget=budget,
        )
        if isinstance(said, GivenUp | str):
            return said if isinstance(said, str) else said.reason
        task = None
        if said.task is not None and said.meaning is not None and world and self._planner:
            words = sentence, said.meaning, vocabulary, now
            try:
                task = checked_task(said.task, *words, self._planner, world)
            except ProposalRefused as why:
                log.info("a task is not offered: %s", why)
            except Exception:
                # What a model says must never stop the fleet, whatever it is.
                log.exception("checking a task of the language model")
        return Paraphrase(said.text, task)


class _Said(NamedTuple):
    """An answer that was read; one that can mean several things has no `meaning`."""

    text: str
    meaning: Reading | None
    task: TaskAnswer | None


def _read(
    text: str,
    vocabulary: Vocabulary,
    now: datetime | None,
    check: Callable[[Reading], object],
) -> _Said | str | Rejected:
    answer = read_answer(text, ParaphraseAnswer)
    if isinstance(answer, str):
        return Rejected.because("malformed", answer)
    sentences = [" ".join(printable(each).split()) for each in answer.sentences]
    if not any(sentences):
        reason = cleaned(answer.reason).strip()
        return f"the language model says: {reason or 'it cannot be said in other words'}"
    said = " ".join(_ended(each) for each in sentences if each)
    if len(sentences) > MOST_SENTENCES or len(said) > MOST_CHARACTERS:
        most = f"at most {MOST_SENTENCES} sentences of {MOST_CHARACTERS:,} characters together"
        return Rejected.because("malformed", f"there may be {most}")
    try:
        found = read(said, vocabulary, now)
        if isinstance(found, Ambiguity):
            return _Said(said, None, None)
        check(found)
    except NotUnderstood as error:
        return Rejected.because("not-understood", str(error))
    return _Said(said, found, answer.task)


def _ended(sentence: str) -> str:
    """A sentence that ends where it ends."""
    return sentence if sentence.endswith((".", "!", "?", ";", ",")) else f"{sentence}."


_FORM = """{"sentences": ["SENTENCE"], "task": null, "reason": ""}, where "task" may be {"name": \
"make_tea", "says": ["make|brew tea [for {who: person}]"], "do": [["SENTENCE", "SENTENCE"], \
["SENTENCE"]]}"""
