"""The language-model planner, with real LiteLLM calls to a scripted server on the loopback."""

from __future__ import annotations

import json

import msgspec
import pytest

from fleet.llm.client import ModelClient
from fleet.planners.base import PlanningProblem
from fleet.planners.llm.answers import GraphAnswer
from fleet.planners.llm.candidate import candidate_of, merged
from keyexpr_schema.payloads.goals import Goal
from tests.support.household import at, bring, fact, home
from tests.support.llm_plans import GOOD, WRONG, carry, fell_back, flat, graph, solve, task
from tests.support.llm_server import LlmServer, Reply


# --- answers that are right ----------------------------------------------------------------------
def test_a_good_answer_becomes_the_plan(model_client: ModelClient) -> None:
    with LlmServer(Reply(GOOD, tokens=(1200, 300))) as server:
        plan = solve(
            server, model_client, usd_per_million_tokens_in=1.0, usd_per_million_tokens_out=10.0
        )
    assert plan.made_by == "llm"
    assert [t.task for t in plan.tasks] == [f"t{n}" for n in range(1, 9)]
    assert {t.actor for t in plan.tasks} == {"a1", "a2"}
    assert {t.goal for t in plan.tasks} == {"g1", "g2"}
    making = plan.making
    assert (making.planner, making.model, making.rounds) == ("llm", "openai/scripted", 1)
    assert (making.tokens_in, making.tokens_out) == (1200, 300)
    assert making.cost_usd == pytest.approx(0.0042)
    assert making.fallback is None
    assert making.prompts == "v1"
    assert making.wall_s > 0
    asked = server.requests[0]["response_format"]["json_schema"]["schema"]
    assert asked["properties"]["tasks"]["items"]["anyOf"][0]["properties"]["skill"]
    prompt = server.prompt(0)
    for words in ("at(cup_1) = kitchen", "Bring cup 1 to the hallway", "grip >= mass(object)"):
        assert words in prompt
    assert server.keys == ["Bearer none"]


def test_the_models_own_order_is_kept_in_a_graph(model_client: ModelClient) -> None:
    """ "First … then …" is not in the conditions; the model's edges are all there is of it."""
    second = carry(2, "living_room", "?a2")
    second[0]["after"] = ["put1"]
    with LlmServer(Reply(graph(*carry(1, "hallway", "?a1"), *second))) as server:
        plan = solve(server, model_client)
    by_name = {t.task: t for t in plan.tasks}
    put = next(t for t in plan.tasks if t.skill == "place" and t.goal == "g1")
    go = next(t for t in plan.tasks if t.goal == "g2")
    assert by_name[go.task].after == (put.task,)


def test_names_go_on_where_the_last_revision_ended(model_client: ModelClient) -> None:
    with LlmServer(Reply(GOOD)) as server:
        plan = solve(server, model_client, first_task=9)
    assert plan.tasks[0].task == "t9"
    assert plan.tasks[0].actor == "a9-1"


def test_a_flat_list_is_loosened(model_client: ModelClient) -> None:
    rows = flat(*carry(1, "hallway", "?a1"), *carry(2, "living_room", "?a2"))
    with LlmServer(Reply(rows)) as server:
        plan = solve(server, model_client, strategy="monolithic")
    assert plan.strategy == "monolithic"
    assert plan.made_by == "llm"
    assert [t.task for t in plan.tasks if not t.after] == ["t1", "t5"]
    assert "after" not in json.dumps(server.requests[0]["response_format"])


def test_each_goal_gets_a_graph_of_its_own(model_client: ModelClient) -> None:
    replies = [
        Reply(graph(*carry(1, "hallway", "?a"))),
        Reply(graph(*carry(2, "living_room", "?a"))),
    ]
    with LlmServer(*replies) as server:
        plan = solve(server, model_client, strategy="per-goal")
    assert plan.made_by == "llm"
    assert plan.making.rounds == 2
    assert len({t.actor for t in plan.tasks}) == 2
    assert [t.task for t in plan.tasks if not t.after] == ["t1", "t5"]
    assert "cup 2 to the" not in server.prompt(0)


def test_a_robot_that_a_goal_names_is_pinned(model_client: ModelClient) -> None:
    second = Goal(goal="g2", text="send it", conditions=(at("locobot", "kitchen"),), ordinal=2)
    go = task("go", "navigate", [], "g2", robot="?r", to="kitchen")
    replies = [
        Reply(graph(*carry(1, "hallway", "?a"))),
        Reply(graph(go, pins=[{"actor": "?r", "robot": "locobot"}])),
    ]
    with LlmServer(*replies) as server:
        plan = solve(server, model_client, (bring(1, "hallway"), second), strategy="per-goal")
    assert plan.made_by == "llm"
    assert list(plan.pins.values()) == ["locobot"]
    assert '"at(cup_1) = hallway"' in server.prompt(1), "what the first goal reached is to be kept"


def test_a_goal_does_not_undo_another(model_client: ModelClient) -> None:
    """The second goal's graph takes the first one's cup away again, and is sent back."""
    thief = [{**row, "goal": "g2"} for row in carry(1, "living_room", "?b")]
    for row in thief[:2]:
        row["args"] = {k: v.replace("kitchen", "hallway") for k, v in row["args"].items()}
    right = carry(2, "living_room", "?b")
    replies = [
        Reply(graph(*carry(1, "hallway", "?a"))),
        Reply(graph(*right, *thief)),
        Reply(graph(*right)),
    ]
    with LlmServer(*replies) as server:
        plan = solve(server, model_client, strategy="per-goal")
    assert plan.making.rounds == 3
    assert len(plan.tasks) == 8


def test_candidates_wait_for_what_they_need_of_each_other() -> None:
    world = home()
    first, second = bring(1, "hallway"), bring(2, "living_room")
    on = [{**row, "goal": "g2"} for row in carry(1, "living_room", "?a")]
    for row in on[:2]:
        row["args"] = {k: v.replace("kitchen", "hallway") for k, v in row["args"].items()}
    problem = PlanningProblem("p", (first, second), world)
    candidates = [
        candidate_of(msgspec.convert(graph(*rows), GraphAnswer), problem, [goal], world)
        for rows, goal in ((carry(1, "hallway", "?a"), first), (on, second))
    ]
    plan = merged(candidates, problem, keep_order=True)
    assert [t.task for t in plan.tasks if not t.after] == ["t1", "t5"]
    assert set(plan.tasks[5].after) == {"t4", "t5"}, "picked up again once it was put down"


def test_goals_that_hold_cost_nothing(model_client: ModelClient) -> None:
    with LlmServer(Reply(GOOD)) as server:
        plan = solve(server, model_client, (bring(1, "kitchen"),))
    assert plan.tasks == ()
    assert server.requests == []


# --- correction ----------------------------------------------------------------------------------
def test_a_wrong_answer_is_corrected_by_the_checkers_sentences(model_client: ModelClient) -> None:
    with LlmServer(Reply(WRONG), Reply(GOOD)) as server:
        plan = solve(server, model_client)
    assert plan.made_by == "llm"
    assert plan.making.rounds == 2
    prompt = server.requests[1]["messages"][-1]["content"]
    assert "at(cup_2) = living_room does not hold when the plan is done" in prompt
    assert '"code": "goal-unmet"' in prompt
    assert '"subject": "cup_2"' in prompt
    assert "put2" in server.requests[1]["messages"][-2]["content"]


def test_a_misspelt_name_is_answered_with_the_choices(model_client: ModelClient) -> None:
    bad = graph(*carry(1, "hall", "?a1"), *carry(2, "living_room", "?a2"))
    with LlmServer(Reply(bad), Reply(GOOD)) as server:
        assert solve(server, model_client).made_by == "llm"
    assert "(there are hallway, kitchen, living_room)" in server.prompt(1)


def test_more_robots_than_there_are_is_said(model_client: ModelClient) -> None:
    """The checker passes each actor; that there is one hand for both is found by allocation."""
    hold = [
        task(f"{step}{n}", skill, after, f"g{n}", robot=f"?a{n}", **args)
        for n in (1, 2)
        for step, skill, after, args in (
            ("go", "navigate", [], {"to": "kitchen"}),
            ("pick", "pick", [f"go{n}"], {"object": f"cup_{n}", "place": "kitchen"}),
        )
    ]
    hold[3]["after"] += ["pick1"]
    # Both hand their cup to the other's basket: two grippers and two baskets.
    swap = [
        task("meet1", "navigate", ["pick1"], "g1", robot="?a1", to="hallway"),
        task("meet2", "navigate", ["pick2"], "g2", robot="?a2", to="hallway"),
        task(
            "put1",
            "place_on_robot",
            ["meet1", "meet2"],
            "g1",
            robot="?a1",
            object="cup_1",
            carrier="?a2",
            place="hallway",
        ),
    ]
    goals = (bring(1, "hallway"),)
    with LlmServer(Reply(graph(*hold, *swap)), Reply(graph(*carry(1, "hallway", "?a1")))) as server:
        assert solve(server, model_client, goals).made_by == "llm"
    assert len(server.requests) == 2


def test_hopeless_answers_end_with_the_symbolic_planner(model_client: ModelClient) -> None:
    with LlmServer(Reply(WRONG)) as server:
        plan = solve(server, model_client, max_repairs=2, strategy="monolithic")
        assert len(server.requests) == 3
    fell_back(plan, "no answer of the language model in 3 rounds was right")
    assert plan.making.rounds == 3
    assert plan.strategy == "monolithic"


# --- what is not known ---------------------------------------------------------------------------
def test_what_nobody_has_seen_is_looked_for_without_asking(model_client: ModelClient) -> None:
    world = home(facts=(fact("cup_1", "at", None),))
    with LlmServer(Reply(GOOD)) as server:
        plan = solve(server, model_client, world=world)
        assert server.requests == []
    fell_back(plan, "nobody knows where cup_1 is")
    assert plan.seeks == ("cup_1",)
