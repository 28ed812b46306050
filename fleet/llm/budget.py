"""What one plan may cost and has cost in calls to a language model: rounds, tokens, money, time."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

from fleet.llm.client import ModelAnswer
from fleet.llm.configuration import LlmConfig
from keyexpr_schema.payloads.plans import Making

CHARS_PER_TOKEN = 3
"""For estimates before a call; English has about four, JSON and names fewer."""


@dataclass
class Budget:
    """What is spent so far, and whether more may be. Times in s of `clock`.

    `prompts` is the version of the prompts, for the account in the plan.
    """

    config: LlmConfig
    prompts: str
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

    def spend(self, answer: ModelAnswer) -> None:
        """Count a round, with its tokens and their price."""
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

    def exceeded_by(self, prompt_chars: int) -> str | None:
        """Why a call with a prompt of that length could exceed the budget, or `None`."""
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

    def making(self, planner: str, fallback: str | None = None) -> Making:
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
            prompts=self.prompts,
        )
