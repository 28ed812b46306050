"""Conversations with a language model: correction rounds until the answer is right, and retries."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from msgspec.structs import replace

from fleet.llm.budget import Budget
from fleet.llm.client import START_TIMEOUT_S, ModelAnswer, ModelClient
from fleet.llm.configuration import LlmConfig, Structured
from fleet.llm.prompts import load_prompts
from fleet.llm.quoting import cleaned, violations_text
from keyexpr_schema.payloads.plans import Violation

log = logging.getLogger(__name__)

MAX_ECHO = 20_000
"""Characters of a rejected answer that are shown to the model again."""
RETRYABLE = frozenset({"rate-limit", "unavailable"})

T = TypeVar("T")


@dataclass(frozen=True)
class Rejected:
    """What is wrong with an answer: at least one reason."""

    violations: tuple[Violation, ...]

    @classmethod
    def because(cls, code: str, sentence: str) -> Rejected:
        """For one reason."""
        return cls((Violation(code=code, sentence=sentence),))


@dataclass(frozen=True)
class GivenUp:
    """Why no usable answer came, in one sentence; `violations` are those of the last answer."""

    reason: str
    violations: tuple[Violation, ...] = ()


class LanguageModel:
    """The configured model, if any; which all that ask one share. Thread-safe."""

    def __init__(self, config: LlmConfig, client: ModelClient | None = None) -> None:
        """`client` can be shared by models of different configurations.

        Raises:
            BadLlmConfig: the prompts that the configuration asks for cannot be used.
        """
        self.config = config
        self._prompts = load_prompts(config)
        self._client = client or ModelClient()
        self._plain = threading.Event()
        """Set once the server has refused the JSON schema."""
        if config.structured is Structured.PLAIN:
            self._plain.set()

    @property
    def configured(self) -> bool:
        """Whether there is a model to ask."""
        return self.config.not_configured is None

    @property
    def longest_s(self) -> float:
        """How long the calls for one plan take at most, s; none where no model is configured."""
        return self.config.max_wall_s + START_TIMEOUT_S if self.configured else 0.0

    def warm(self) -> None:
        """Start what takes seconds to start, if a model is configured. Blocks until it runs."""
        if self.configured:
            self._client.warm()

    def close(self) -> None:
        """Stop asking: a call that is under way ends at once, and so does any later one."""
        self._client.close()

    def budget(self) -> Budget:
        """A new budget: that of one plan."""
        return Budget(self.config, self._prompts.version)

    def ask(
        self,
        *,
        system: str,
        question: str,
        correction: str,
        values: Mapping[str, str],
        schema: dict[str, Any],
        read: Callable[[str], T | Rejected],
        budget: Budget | None = None,
    ) -> T | GivenUp:
        """The answer that `read` takes, or why there is none. Blocks, and never raises.

        `system`, `question` and `correction` name prompts; `values` fill the placeholders of the
        question, `$violations` and `$details` those of the correction, which tells the model what
        was wrong with its answer. Without a `budget` the call has one of its own.
        """
        if reason := self.config.not_configured:
            return GivenUp(reason)
        messages = [
            {"role": "system", "content": self._prompts.fill(system)},
            {"role": "user", "content": self._prompts.fill(question, **values)},
        ]
        try:
            return self._converse(messages, correction, schema, read, budget or self.budget())
        except Exception as error:
            # What a model says must never stop the fleet, whatever it is.
            log.exception("asking the language model")
            said = str(error) or type(error).__name__
            return GivenUp(f"asking the language model failed: {said}")

    def _converse(
        self,
        messages: list[dict[str, str]],
        correction: str,
        schema: dict[str, Any],
        read: Callable[[str], T | Rejected],
        budget: Budget,
    ) -> T | GivenUp:
        rounds = 1 + self.config.max_repairs
        violations: tuple[Violation, ...] = ()
        for _ in range(rounds):
            answer = self._call(messages, schema, budget)
            if isinstance(answer, str):
                return GivenUp(answer, violations)
            made = _unusable(answer) or read(answer.text)
            if not isinstance(made, Rejected):
                return made
            # A model's own words may stand in them: people read these in terminals and logs.
            violations = tuple(
                replace(row, sentence=cleaned(row.sentence)) for row in made.violations
            )
            log.info("answer rejected: %s", violations[0].sentence)
            sentences, details = violations_text(violations)
            corrected = self._prompts.fill(correction, violations=sentences, details=details)
            messages += [
                {"role": "assistant", "content": answer.text[:MAX_ECHO] or "(nothing)"},
                {"role": "user", "content": corrected},
            ]
        more = len(violations) - 1
        return GivenUp(
            f"no answer of the language model in {rounds} rounds was right; "
            f"of the last: {violations[0].sentence}" + (f" (and {more} more)" if more else ""),
            violations,
        )

    def _call(
        self, messages: list[dict[str, str]], schema: dict[str, Any], budget: Budget
    ) -> ModelAnswer | str:
        """One answer, after retries; or why there is none."""
        config = self.config
        wait_s = config.retry_wait_s
        tries = 0
        while True:
            chars = sum(len(message["content"]) for message in messages)
            if stop := budget.exceeded_by(chars):
                return stop
            plain = self._plain.is_set()
            request = self._request(messages, None if plain else schema)
            answer = self._client.call(request, min(config.timeout_s, budget.left_s))
            if answer.kind in ("answer", "oversized"):
                budget.spend(answer)
            if answer.kind == "form" and not plain and config.structured is Structured.AUTO:
                log.info("%s does not take a JSON schema: %s", config.model, answer.error)
                self._plain.set()
                continue
            pause_s = wait_s if answer.retry_after_s is None else max(answer.retry_after_s, 0.0)
            if answer.kind not in RETRYABLE or tries >= config.retries or pause_s >= budget.left_s:
                break
            tries += 1
            time.sleep(pause_s)
            wait_s *= 2
        if answer.kind == "answer":
            return answer
        said = cleaned(answer.error)
        return f"the language model {config.model} gave no answer ({answer.kind}): {said}"

    def _request(
        self, messages: list[dict[str, str]], schema: dict[str, Any] | None
    ) -> dict[str, Any]:
        config = self.config
        request: dict[str, Any] = {
            **config.options,
            "model": config.model,
            "messages": messages,
            "max_tokens": config.max_tokens,
            "api_key_env": config.api_key_env,
        }
        if config.api_base is not None:
            request["api_base"] = config.api_base
        if config.temperature is not None:
            request["temperature"] = config.temperature
        if schema is not None:
            request["response_format"] = {
                "type": "json_schema",
                "json_schema": {"name": "answer", "strict": True, "schema": schema},
            }
        return request


def _unusable(answer: ModelAnswer) -> Rejected | None:
    """What is wrong with an answer before it is read."""
    if answer.refusal:
        return Rejected.because("refused", f"the model refused: {answer.refusal}")
    if answer.finish == "content_filter":
        return Rejected.because("refused", "the answer was stopped by a content filter")
    if answer.finish == "length":
        sentence = "the answer was cut off at its greatest length: say the same in fewer words"
        return Rejected.because("truncated", sentence)
    if not answer.text.strip():
        return Rejected.because("empty", "the answer is empty")
    return None
