"""Tasks that a language model proposes: read and planned before they are offered."""

from __future__ import annotations

from dataclasses import replace as changed

import pytest

from fleet.core.model.world import WorldModel
from fleet.language import Reading, Vocabulary, read
from fleet.language.methods.model import CompoundTask, Method
from fleet.llm.client import ModelClient
from fleet.llm.configuration import LlmConfig
from fleet.llm.conversation import LanguageModel
from fleet.planners.llm.paraphraser import LlmParaphraser, Paraphrase
from fleet.planners.symbolic.planner import SymbolicPlanner
from tests.support.household import home
from tests.support.llm_server import LlmServer, Reply

WORLD = home()
WORDS = Vocabulary(WORLD.places, WORLD.objects, WORLD.robots)
TEA = "make tea for the hallway"
SLOT = "make|brew tea for {where: place}"
BOTH = ["bring cup 1 to {where}", "bring cup 2 to {where}"]


def proposing(says: str, *do: list[str], name: str = "make_tea") -> Reply:
    sentences = ["Bring cup 1 to the hallway.", "Bring cup 2 to the hallway."]
    task = {"name": name, "says": [says], "do": list(do)}
    return Reply({"sentences": sentences, "task": task, "reason": ""})


def proposed(
    model_client: ModelClient, reply: Reply, world: WorldModel = WORLD, words: Vocabulary = WORDS
) -> CompoundTask | None:
    """The task that is offered; the paraphrase is there in any case."""
    with LlmServer(reply) as server:
        config = LlmConfig(model="openai/scripted", api_base=server.api_base)
        paraphraser = LlmParaphraser(LanguageModel(config, model_client), SymbolicPlanner())
        made = paraphraser.paraphrase(TEA, "it is not understood", words, world=world)
    assert isinstance(made, Paraphrase)
    assert made.text == "Bring cup 1 to the hallway. Bring cup 2 to the hallway."
    assert len(server.requests) == 1
    return made.task


def test_a_task_that_means_the_same_and_can_be_done_is_offered(model_client: ModelClient) -> None:
    task = proposed(model_client, proposing(SLOT, BOTH))
    assert task is not None
    assert (task.name, task.says) == ("make_tea", (SLOT,))
    found = read("Brew tea for the living room.", changed(WORDS, tasks=(task,)))
    assert isinstance(found, Reading)
    assert set(map(str, found.stages[0])) == {
        "at(cup_1) = living_room",
        "at(cup_2) = living_room",
    }


@pytest.mark.parametrize(
    ("reply", "words"),
    [
        (proposing("make tea", BOTH), "names {where}"),
        (proposing("brew tea for {where: place}", BOTH), "'tea' is not"),
        (proposing(SLOT, BOTH[:1]), "means at(cup_1) = hallway"),
        (proposing(SLOT, *([each] for each in BOTH)), "means at(cup_1) = hallway, then"),
        (proposing(SLOT, ["zorgle {where}"]), "zorgle"),
        (proposing(SLOT, BOTH, name="make tea; rm"), "one word"),
        (proposing(SLOT, [BOTH[0]] * 21), "at most 10 phrases and 20 sentences"),
        (proposing("(make tea for|search) {where: place}", BOTH), "which is read already"),
    ],
)
def test_a_task_that_is_not_right_is_not_offered(
    model_client: ModelClient, caplog: pytest.LogCaptureFixture, reply: Reply, words: str
) -> None:
    with caplog.at_level("INFO"):
        assert proposed(model_client, reply) is None
    (said,) = (r.getMessage() for r in caplog.records if "not offered" in r.getMessage())
    assert words in said


def test_a_task_that_cannot_be_done_is_not_offered(
    model_client: ModelClient, caplog: pytest.LogCaptureFixture
) -> None:
    idle = changed(WORLD, available=frozenset())
    with caplog.at_level("INFO"):
        assert proposed(model_client, proposing(SLOT, BOTH), idle) is None
    assert "cannot be done: no robot is connected" in caplog.text


def test_a_task_that_is_known_is_not_proposed_anew(model_client: ModelClient) -> None:
    method = Method(do=(("bring cup 1 to the hallway",),))
    known = CompoundTask(name="make_tea", says=("make cocoa",), methods=(method,))
    words = changed(WORDS, tasks=(known,))
    assert proposed(model_client, proposing(SLOT, BOTH), words=words) is None
