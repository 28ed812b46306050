"""Lets the language-model allocator ask through the planner's conversation."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from fleet.allocators.llm import Choice
from fleet.llm.conversation import Conversation, GivenUp, Ledger, Rejected
from fleet.llm.prompts import Prompts
from fleet.planners.llm import LlmConfig, ModelCaller
from keyexpr_schema.payloads.plans import Violation


class AllocationAsker:
    """An `Asker` (see `fleet.allocators.llm`) over a configured language model.

    Every call has a budget of its own, that of one plan.
    """

    def __init__(self, config: LlmConfig, caller: ModelCaller) -> None:
        """`caller` can be shared with a planner, whose `close` then ends calls under way."""
        self._config = config
        self._caller = caller

    def __call__(
        self,
        system: str,
        question: str,
        repair: str,
        schema: dict[str, Any],
        read: Callable[[str], Choice | tuple[Violation, ...]],
    ) -> Choice | str:
        """The choice that `read` took, or one sentence on why there is none. Blocks."""
        if told := self._config.not_configured:
            return told

        def taken(text: str) -> Choice | Rejected:
            made = read(text)
            return made if isinstance(made, dict) else Rejected(made)

        prompts = Prompts("allocation", {"repair": repair, "house-rules": ""})
        conversation = Conversation(self._config, prompts, self._caller)
        made = conversation.ask(system, question, "repair", schema, taken, Ledger(self._config))
        return made.reason if isinstance(made, GivenUp) else made
