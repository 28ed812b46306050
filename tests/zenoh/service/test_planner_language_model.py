"""The planner process with a language model: a scripted server at the end of the real calls."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from cli.client.publish import answer_goal
from keyexpr_schema.keyspace import GOAL_SPEC, GOAL_STATUS, PLAN_STATUS
from keyexpr_schema.payloads.goals import GoalAddress, GoalState
from keyexpr_schema.payloads.plans import PlanAddress, PlanState
from tests.support.llm_server import LlmServer, Reply
from tests.support.planner_process import (
    ask_for_plan,
    finish,
    have_planned,
    person,
    planner,
    value,
    want,
)
from tests.support.router_process import RouterProcess

pytestmark = pytest.mark.slow


def configured(server: LlmServer, folder: Path, more: str = "") -> tuple[str, str]:
    """The option that has a planner ask this server; `more` is another section of the file."""
    path = folder / "llm.yaml"
    path.write_text(f"llm: {{model: openai/scripted, api_base: {server.api_base}}}\n{more}\n")
    return "--llm-config", str(path)


def row(name: str, skill: str, after: list[str], **args: str) -> dict[str, Any]:
    return {
        "task": name,
        "skill": skill,
        "args": {"robot": "?a", **args},
        "after": after,
        "goal": "g",
    }


GOOD = {
    "tasks": [
        row("t1", "navigate", [], to="kitchen"),
        row("t2", "pick", ["t1"], object="cup_1", place="kitchen"),
        row("t3", "navigate", ["t2"], to="hallway"),
        row("t4", "place", ["t3"], object="cup_1", place="hallway"),
    ],
    "pins": [],
}
UNCHECKED = {"tasks": [GOOD["tasks"][3]], "pins": []}


async def test_a_models_plan_is_repaired_and_carried_out(
    router: RouterProcess, tmp_path: Path
) -> None:
    with LlmServer(Reply(UNCHECKED), Reply(GOOD)) as server:
        options = configured(server, tmp_path)
        async with (
            planner(router.endpoint, tmp_path / "p", *options),
            person(router.endpoint) as session,
        ):
            await ask_for_plan(session, by="llm")
            status = await value(session, PLAN_STATUS, PlanAddress("p"), state=PlanState.RUNNING)
            assert (status.making.planner, status.making.rounds) == ("llm", 2)
            assert status.making.fallback is None
            assert status.making.tokens_in == 200
            await finish(session, set())


async def test_a_hopeless_model_is_replaced_by_the_symbolic_planner(
    router: RouterProcess, tmp_path: Path
) -> None:
    with LlmServer(Reply("I would rather not.")) as server:
        options = configured(server, tmp_path)
        async with (
            planner(router.endpoint, tmp_path / "p", *options),
            person(router.endpoint) as session,
        ):
            await ask_for_plan(session, by="llm")
            status = await value(session, PLAN_STATUS, PlanAddress("p"), state=PlanState.RUNNING)
            assert status.made_by == "symbolic"
            assert "JSON" in (status.making.fallback or "")
            await finish(session, set())


ODD = "Guests will be thirsty where the coats hang."


async def test_a_sentence_that_the_grammar_refuses_is_paraphrased_and_confirmed(
    router: RouterProcess, tmp_path: Path
) -> None:
    wrong = Reply({"sentences": ["Zorgle cup 1."], "reason": ""})
    right = Reply({"sentences": ["Bring cup 1 to the hallway."], "reason": ""})
    with LlmServer(wrong, right) as server:
        options = configured(server, tmp_path)
        async with (
            planner(router.endpoint, tmp_path / "p", *options),
            person(router.endpoint) as session,
        ):
            await want(session, ODD)
            meant = ("at(cup_1) = hallway",)
            status = await value(session, GOAL_STATUS, GoalAddress("g"), candidates=meant)
            assert status.state is GoalState.REJECTED
            assert status.paraphrase == "Bring cup 1 to the hallway."
            assert "'Zorgle" in server.requests[1]["messages"][-1]["content"]
            goal = await session.get(GOAL_SPEC, GoalAddress("g"))
            assert goal is not None
            await answer_goal(session, goal, status, "yes")
            await have_planned(session)
            status = await value(session, GOAL_STATUS, GoalAddress("g"), state=GoalState.RUNNING)
            assert [str(condition) for condition in status.conditions] == ["at(cup_1) = hallway"]
            await finish(session, set())
            assert len(server.requests) == 2


async def test_what_needs_no_confirmation_is_carried_out(
    router: RouterProcess, tmp_path: Path
) -> None:
    with LlmServer(Reply({"sentences": ["Bring cup 1 to the hallway."], "reason": ""})) as server:
        options = configured(server, tmp_path, "language: {confirm: never}")
        async with (
            planner(router.endpoint, tmp_path / "p", *options),
            person(router.endpoint) as session,
        ):
            await ask_for_plan(session, ODD)
            await value(session, GOAL_STATUS, GoalAddress("g"), state=GoalState.RUNNING)
            await finish(session, set())
