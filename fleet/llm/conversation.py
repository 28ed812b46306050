"""Asking until the answer is right: rounds of repair, retries of calls, and what it may cost."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeVar

from fleet.llm.client import ModelAnswer, ModelCaller
from fleet.llm.configuration import LlmConfig, Structured
from fleet.llm.prompts import Prompts
from fleet.llm.quoting import violations_text
from keyexpr_schema.payloads.plans import Making, Violation

log = logging.getLogger(__name__)

CHARS_PER_TOKEN = 3
"""For estimates before a call; English has about four, JSON and names fewer."""
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


@dataclass
class Ledger:
    """What one plan has cost so far, and whether more may be spent. Times in s of `clock`."""

    config: LlmConfig
    clock: Callable[[], float] = time.monotonic
    rounds: int = 0
    tokens_in: int = 0
    tokens_out: int = 0
    usd: float | None = None
    unpriced: bool = False
    started: float = field(init=False)

    def __post_init__(self) -> None:
        self.started = self.clock()

    @property
    def wall_s(self) -> float:
        """Seconds since the start."""
        return self.clock() - self.started

    @property
    def left_s(self) -> float:
        """Seconds that are left for the plan."""
        return self.config.max_wall_s - self.wall_s

    def add(self, answer: ModelAnswer) -> None:
        """Book an answer."""
        config = self.config
        self.rounds += 1
        self.tokens_in += answer.tokens_in
        self.tokens_out += answer.tokens_out
        usd = answer.usd
        price_in, price_out = config.usd_per_million_tokens_in, config.usd_per_million_tokens_out
        if price_in is not None and price_out is not None:
            usd = (answer.tokens_in * price_in + answer.tokens_out * price_out) / 1e6
        if usd is None:
            self.unpriced = True
        else:
            self.usd = (self.usd or 0.0) + usd

    def why_stop(self, prompt_chars: int) -> str | None:
        """Why another call with a prompt of that length would go too far, or `None`."""
        config = self.config
        if self.left_s <= 0:
            return f"the {config.max_wall_s:g} s for asking the language model are over"
        spent = self.tokens_in + self.tokens_out
        needed = prompt_chars // CHARS_PER_TOKEN + config.max_tokens
        if spent + needed > config.max_tokens_per_plan:
            return (
                f"another round could take {needed} tokens, and of {config.max_tokens_per_plan} "
                f"for a plan {spent} are spent"
            )
        if config.max_usd_per_plan is not None:
            if self.unpriced:
                return (
                    "the price of the language model is not known, so the budget in USD cannot be "
                    "kept: give usd_per_million_tokens_in and …_out"
                )
            if (self.usd or 0.0) >= config.max_usd_per_plan:
                return f"the {config.max_usd_per_plan:g} USD for a plan are spent"
        return None

    def making(self, planner: str, prompts: Prompts, fallback: str | None = None) -> Making:
        """The account, as it stands in a plan."""
        return Making(
            planner=planner,
            model=self.config.model,
            rounds=self.rounds,
            tokens_in=self.tokens_in,
            tokens_out=self.tokens_out,
            cost_usd=None if self.unpriced else self.usd,
            wall_s=round(self.wall_s, 3),
            fallback=fallback,
            prompts=prompts.version,
        )


class Conversation:
    """Asks one model; made once, used from any thread."""

    def __init__(self, config: LlmConfig, prompts: Prompts, caller: ModelCaller) -> None:
        self._config = config
        self._prompts = prompts
        self._caller = caller
        self._plain = threading.Event()
        """Set once the server has refused the JSON schema."""
        if config.structured is Structured.PLAIN:
            self._plain.set()

    def ask(
        self,
        system: str,
        question: str,
        repair: str,
        schema: dict[str, Any],
        read: Callable[[str], T | Rejected],
        ledger: Ledger,
    ) -> T | GivenUp:
        """The answer that `read` takes, or why there is none.

        `repair` names the prompt that tells the model what was wrong with an answer.
        """
        messages = [
            {"role": "system", "content": system},
            {"role": "user", "content": question},
        ]
        violations: tuple[Violation, ...] = ()
        for _ in range(1 + self._config.max_repairs):
            answer = self._call(messages, schema, ledger)
            if isinstance(answer, str):
                return GivenUp(answer, violations)
            made = _unusable(answer) or read(answer.text)
            if not isinstance(made, Rejected):
                return made
            violations = made.violations
            log.info("answer rejected: %s", violations[0].sentence)
            sentences, details = violations_text(violations)
            said = answer.text[:MAX_ECHO] or "(nothing)"
            told = self._prompts.fill(repair, violations=sentences, details=details)
            messages += [
                {"role": "assistant", "content": said},
                {"role": "user", "content": told},
            ]
        more = len(violations) - 1
        return GivenUp(
            f"no answer of the language model in {1 + self._config.max_repairs} rounds was right; "
            f"of the last: {violations[0].sentence}" + (f" (and {more} more)" if more else ""),
            violations,
        )

    def _call(
        self, messages: list[dict[str, str]], schema: dict[str, Any], ledger: Ledger
    ) -> ModelAnswer | str:
        """One answer, after retries; or why there is none."""
        config = self._config
        wait_s = config.retry_wait_s
        tries = 0
        while True:
            chars = sum(len(message["content"]) for message in messages)
            if stop := ledger.why_stop(chars):
                return stop
            plain = self._plain.is_set()
            request = self._request(messages, None if plain else schema)
            answer = self._caller.call(request, min(config.timeout_s, ledger.left_s))
            if answer.kind in ("answer", "oversized"):
                ledger.add(answer)
            if answer.kind == "form" and not plain and config.structured is Structured.AUTO:
                log.info("%s does not take a JSON schema: %s", config.model, answer.error)
                self._plain.set()
                continue
            pause_s = wait_s if answer.retry_after_s is None else max(answer.retry_after_s, 0.0)
            if answer.kind not in RETRYABLE or tries >= config.retries or pause_s >= ledger.left_s:
                break
            tries += 1
            time.sleep(pause_s)
            wait_s *= 2
        if answer.kind == "answer":
            return answer
        return f"the language model {config.model} gave no answer ({answer.kind}): {answer.error}"

    def _request(
        self, messages: list[dict[str, str]], schema: dict[str, Any] | None
    ) -> dict[str, Any]:
        config = self._config
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
