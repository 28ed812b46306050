"""The allocator that asks a language model."""

from __future__ import annotations

import json
from typing import Any

from fleet.allocators.base import Allocated
from fleet.allocators.llm import LlmAllocator
from fleet.allocators.min_max_load import MinMaxLoadAllocator, TieBreak
from fleet.allocators.round_robin import RoundRobinAllocator
from fleet.llm.client import ModelAnswer, ModelClient
from fleet.llm.configuration import LlmConfig
from fleet.llm.conversation import LanguageModel
from tests.support.household import checked, drives, home, manipulator
from tests.support.llm_server import LlmServer, Reply
from tests.support.polling import DEADLINE_S

TEAM = (manipulator("r1"), manipulator("r2"))


def by_model(server: LlmServer, model_client: ModelClient) -> LlmAllocator:
    """Through the conversation of the language-model planner, repairs and budget included."""
    config = LlmConfig(
        model="openai/scripted", api_base=server.api_base, timeout_s=DEADLINE_S, retry_wait_s=0.01
    )
    return LlmAllocator(
        LanguageModel(config, model_client), MinMaxLoadAllocator(TieBreak.NEXT_LOADS)
    )


def answer(**robots: str) -> Reply:
    return Reply({"robots": [{"actor": a, "robot": r} for a, r in robots.items()]})


def test_a_language_model_is_told_what_is_wrong_and_mends_it(model_client: ModelClient) -> None:
    world, plan = home(TEAM), drives("", "r2")
    replies = (Reply("no idea"), answer(a0="r9", a1="r1"), answer(a0="r2", a1="r2"))
    with LlmServer(*replies) as server:
        made = by_model(server, model_client).allocate(checked(plan, world))
    assert isinstance(made, Allocated)
    assert made.allocation == {"a0": "r2", "a1": "r2"}
    question = json.dumps(server.requests[2]["messages"])
    assert "r9 cannot be actor a0; it can be r1, r2" in question
    assert "r1 cannot be actor a1; it can be r2" in question


def test_a_language_model_that_is_never_right_is_replaced_and_that_is_said(
    model_client: ModelClient,
) -> None:
    world, plan = home(TEAM), drives("", "")
    with LlmServer(answer(a0="r1")) as server:
        made = by_model(server, model_client).allocate(checked(plan, world))
    assert isinstance(made, Allocated)
    assert set(made.allocation.values()) == {"r1", "r2"}
    (note,) = made.notes
    assert note.startswith("allocated by balanced and not by language model")
    assert "actor a1 is given no robot" in note


def test_a_language_model_that_fails_stops_nothing() -> None:
    class Unreachable(ModelClient):
        def call(self, request: dict[str, Any], timeout_s: float) -> ModelAnswer:
            raise OSError("no network")

    model = LanguageModel(LlmConfig(model="openai/scripted"), Unreachable())
    made = LlmAllocator(model, RoundRobinAllocator()).allocate(checked(drives(""), home(TEAM)))
    assert isinstance(made, Allocated)
    assert made.notes[0].endswith("asking the language model failed: no network")
