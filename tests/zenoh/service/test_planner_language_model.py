"""The planner process with a language model: a scripted server at the end of the real calls."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from keyexpr_schema.keyspace import GOAL_STATUS, PLAN_STATUS
from keyexpr_schema.payloads.goals import GoalAddress, GoalState
from keyexpr_schema.payloads.plans import PlanAddress
from tests.support.llm_server import LlmServer, Reply
from tests.support.planner_process import ask_for_plan, finish, person, planner, value
from tests.support.router_process import RouterProcess

pytestmark = pytest.mark.slow


def configured(server: LlmServer, folder: Path) -> tuple[str, str]:
    """The option that has a planner ask this server."""
    path = folder / "llm.yaml"
    path.write_text(f"llm: {{model: openai/scripted, api_base: {server.api_base}}}\n")
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
            status = await session.get(PLAN_STATUS, PlanAddress("p"))
            assert status is not None
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
            status = await session.get(PLAN_STATUS, PlanAddress("p"))
            assert status is not None
            assert status.made_by == "symbolic"
            assert "JSON" in (status.making.fallback or "")
            await finish(session, set())


async def test_a_sentence_that_the_grammar_refuses_is_read_by_the_model(
    router: RouterProcess, tmp_path: Path
) -> None:
    wanted = {"relation": "at", "subject": "cup_1", "value": "hallway", "any_of": []}
    read = Reply({"stages": [[wanted]], "reason": ""})
    with LlmServer(read) as server:
        options = configured(server, tmp_path)
        async with (
            planner(router.endpoint, tmp_path / "p", *options),
            person(router.endpoint) as session,
        ):
            await ask_for_plan(session, "Guests will be thirsty where the coats hang.")
            status = await value(session, GOAL_STATUS, GoalAddress("g"), state=GoalState.RUNNING)
            assert [str(condition) for condition in status.conditions] == ["at(cup_1) = hallway"]
            await finish(session, set())
