"""Where the language model fails or costs too much, the symbolic planner plans."""

from __future__ import annotations

import json
from typing import Any

import pytest

from fleet.core.checker.plan_checker import CheckedPlan
from fleet.llm.client import ModelClient
from fleet.llm.configuration import LlmConfig
from fleet.llm.conversation import LanguageModel
from fleet.planners.base import NoPlan, PlanningProblem
from fleet.planners.llm.planner import LlmPlanner
from fleet.planners.symbolic.planner import SymbolicPlanner
from tests.support.household import carrier, fact, home
from tests.support.llm_plans import GOALS, GOOD, WRONG, config, fell_back, graph, solve
from tests.support.llm_server import LlmServer, Reply


# --- answers that are none -----------------------------------------------------------------------
@pytest.mark.parametrize(
    ("reply", "words"),
    [
        (Reply("I would rather talk about the weather."), "not a JSON object"),
        (Reply(""), "the answer is empty"),
        (Reply(None, refusal="I cannot help with robots."), "the model refused: I cannot help"),
        (Reply(json.dumps(GOOD)[:400], finish_reason="length"), "cut off"),
        (Reply("", finish_reason="content_filter"), "content filter"),
        (Reply({"plan": []}), "does not have the form"),
        (Reply({"tasks": [{**GOOD["tasks"][0], "args": [1]}]}), "$.tasks[0].args"),
        (Reply({"tasks": [{**GOOD["tasks"][0], "sudo": True}]}), "unknown field `sudo`"),
        (Reply('{"tasks":' * 20_000), "nested too deeply"),
        (Reply('{"tasks": ' + "9" * 9000 + "}"), "not a JSON object"),
        (Reply(graph(*[GOOD["tasks"][0]] * 300)), "300 tasks; 200 are allowed"),
        (Reply(graph(*GOOD["tasks"], *GOOD["tasks"])), "two tasks are called"),
        (Reply("x" * 300_000), "oversized"),
        (Reply(status=401), "(key)"),
        (Reply(status=404), "(unknown-model)"),
        (Reply(status=500), "(unavailable)"),
        (Reply(status=429), "(rate-limit)"),
        (Reply(raw=b"<html>gateway</html>"), "(unavailable)"),
        (Reply(raw=b'{"choices": []}'), "the answer is empty"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_what_is_no_plan_never_raises(model_client: ModelClient, reply: Reply, words: str) -> None:
    with LlmServer(reply) as server:
        plan = solve(server, model_client, max_repairs=0, retries=1)
        retried = reply.status in (429, 500) or reply.raw == b"<html>gateway</html>"
        assert len(server.requests) == (2 if retried else 1)
    fell_back(plan, words)


@pytest.mark.parametrize(
    ("reply", "words"),
    [(Reply(silent=True), "(timeout)"), (Reply(GOOD, trickle=True), "no whole answer within")],
    ids=["silent", "each byte comes in time, the answer never"],
)
def test_a_server_that_does_not_answer_is_cut_off(reply: Reply, words: str) -> None:
    """Where each byte comes in time, only ending the process ends that."""
    own = ModelClient()
    try:
        own.warm()
        for timeout_s in (0.5, 5.0, 50.0):  # on a busy machine it takes long to ask at all
            with LlmServer(reply) as server:
                plan = solve(server, own, timeout_s=timeout_s, max_repairs=0, retries=1)
            if server.requests and words in (plan.making.fallback or ""):
                break
        fell_back(plan, words)
        assert len(server.requests) == 1
    finally:
        own.close()


def test_a_rate_limit_that_passes_is_waited_for(
    model_client: ModelClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    waits_s: list[float] = []
    monkeypatch.setattr("fleet.llm.conversation.time.sleep", waits_s.append)
    with LlmServer(Reply(status=429, headers={"Retry-After": "0.2"}), Reply(GOOD)) as server:
        plan = solve(server, model_client, retry_wait_s=1000.0)
    assert plan.made_by == "llm"
    assert plan.making.rounds == 1
    assert waits_s == [0.2]


def test_a_wait_that_is_longer_than_the_budget_is_not_begun(model_client: ModelClient) -> None:
    with LlmServer(Reply(status=429, headers={"Retry-After": "3600"})) as server:
        fell_back(solve(server, model_client), "rate-limit")


def test_a_server_without_structured_output_is_asked_in_words(model_client: ModelClient) -> None:
    with LlmServer(Reply(status=400), Reply(f"Sure!\n```json\n{json.dumps(GOOD)}\n```")) as server:
        assert solve(server, model_client).made_by == "llm"
    assert "response_format" in server.requests[0]
    assert "response_format" not in server.requests[1]


def test_nobody_listens(model_client: ModelClient) -> None:
    with LlmServer(Reply(GOOD)) as server:
        gone = config(server, retries=0)
    made = LlmPlanner(LanguageModel(gone, model_client), SymbolicPlanner()).plan(
        PlanningProblem("p", GOALS, home())
    )
    assert isinstance(made, CheckedPlan)
    fell_back(made.plan, "(unavailable)")


# --- budget --------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("fields", "words", "requests"),
    [
        ({"max_tokens_per_plan": 10_000, "max_tokens": 4000}, "for a plan 6000 are spent", 1),
        ({"max_tokens_per_plan": 1000}, "for a plan 0 are spent", 0),
        ({"max_usd_per_plan": 0.01}, "the price of the language model is not known", 1),
        (
            {
                "max_usd_per_plan": 0.01,
                "usd_per_million_tokens_in": 1.0,
                "usd_per_million_tokens_out": 5.0,
            },
            "the 0.01 USD for a plan are spent",
            1,
        ),
    ],
    ids=["tokens", "too few tokens", "no price", "dollars"],
)
def test_the_budget_is_kept(
    model_client: ModelClient, fields: dict[str, Any], words: str, requests: int
) -> None:
    with LlmServer(Reply(WRONG, tokens=(5000, 1000))) as server:
        fell_back(solve(server, model_client, **fields), words)
        assert len(server.requests) == requests


def test_the_time_for_a_plan_is_kept(model_client: ModelClient) -> None:
    with LlmServer(Reply(WRONG), Reply(silent=True)) as server:
        plan = solve(server, model_client, max_wall_s=0.5, timeout_s=1e6)
    fell_back(plan, "")
    assert plan.making.fallback is not None
    assert "(timeout)" in plan.making.fallback or "0.5 s for asking" in plan.making.fallback


# --- without a model -----------------------------------------------------------------------------
def test_without_a_model_it_says_how_to_configure_one() -> None:
    planner = LlmPlanner(LanguageModel(LlmConfig()), SymbolicPlanner())
    made = planner.plan(PlanningProblem("p", GOALS, home()))
    assert isinstance(made, NoPlan)
    assert "`model` under `llm` in configs/planner.yaml" in made.reason


def test_a_key_that_is_not_set_is_named(model_client: ModelClient) -> None:
    with LlmServer(Reply(GOOD)) as server:
        plan = solve(server, model_client, api_key_env="ROBOTFLEET_TEST_NO_SUCH_KEY")
        assert server.requests == []
    fell_back(plan, "the environment variable ROBOTFLEET_TEST_NO_SUCH_KEY is not set")


def test_why_neither_planner_has_a_plan(model_client: ModelClient) -> None:
    world = home((carrier(),), facts=(fact("cup_1", "at", "kitchen"),))
    with LlmServer(Reply(GOOD)) as server:
        planner = LlmPlanner(
            LanguageModel(config(server, max_repairs=0), model_client), SymbolicPlanner()
        )
        made = planner.plan(PlanningProblem("p", GOALS, world))
    assert isinstance(made, NoPlan)
    assert "planner symbolic; before that, no answer of the language model" in made.reason


def test_after_close_the_symbolic_planner_plans() -> None:
    with LlmServer(Reply(GOOD)) as server:
        model = LanguageModel(config(server))
        planner = LlmPlanner(model, SymbolicPlanner())
        model.close()
        made = planner.plan(PlanningProblem("p", GOALS, home()))
    assert isinstance(made, CheckedPlan)
    fell_back(made.plan, "closed")
