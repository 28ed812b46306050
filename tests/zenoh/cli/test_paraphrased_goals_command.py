"""Goals that a language model says in other words, by robotctl: a scripted server at its end."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from tests.support.llm_server import LlmServer, Reply
from tests.support.planner_process import person, planner
from tests.support.robotctl import Robotctl
from tests.support.router_process import RouterProcess

ODD = "The usual with cup one, mon ami"
PLAIN = "Bring cup 1 to the hallway."
MEANING = "at(cup_1) = hallway"


@pytest.fixture
def robotctl(router: RouterProcess, tmp_path: Path) -> Robotctl:
    return Robotctl(router.endpoint, tmp_path, "test")


@asynccontextmanager
async def fleet(
    router: RouterProcess, folder: Path, *said: str, task: dict[str, Any] | None = None
) -> AsyncIterator[LlmServer]:
    """A planner with a language model that says these sentences, whatever it is asked."""
    with LlmServer(Reply({"sentences": list(said), "task": task, "reason": ""})) as server:
        path = folder / "llm.yaml"
        path.write_text(f"llm: {{model: openai/scripted, api_base: {server.api_base}}}\n")
        async with (
            person(router.endpoint, cups=2),
            planner(router.endpoint, folder / "planner", "--llm-config", str(path)),
        ):
            yield server


async def test_what_a_model_has_made_of_a_goal_is_confirmed_by_a_second_command(
    router: RouterProcess, robotctl: Robotctl, tmp_path: Path
) -> None:
    async with fleet(router, tmp_path, PLAIN):
        asked = await robotctl.soon("goal", "add", ODD, "--id", "g")
        data = (await robotctl.soon("goal", "show", "g", "--json")).data["status"]
        page = (await robotctl.soon("goal", "show", "g")).out
        no = await robotctl.soon("goal", "answer", "g", "no")
        unplanned = await robotctl.soon("plan", "create", "big-dag", "milp", "g")
        said = await robotctl.soon("goal", "answer", "g", "yes")
        again = await robotctl.soon("goal", "answer", "g", "yes")
        as_data = await robotctl.soon("goal", "add", ODD, "--id", "h", "--json")
    assert asked.code == 1
    assert PLAIN in asked.err
    assert "robotctl goal answer g yes" in asked.err
    assert data["state"] == "rejected"
    assert data["candidates"] == [MEANING]
    assert data["paraphrase"] == PLAIN
    assert "usual" in data["refusal"]
    assert PLAIN in page
    assert MEANING in page
    assert no.code != 0
    assert MEANING in no.err
    assert unplanned.code != 0
    assert said.code == 0, said.err
    assert f"understood as {MEANING}" in said.out
    assert PLAIN in said.out
    assert "does not ask anything" in again.err
    assert as_data.code == 1
    assert as_data.data["status"]["candidates"] == [MEANING]


async def test_somebody_at_a_terminal_is_asked(
    router: RouterProcess, robotctl: Robotctl, tmp_path: Path
) -> None:
    async with fleet(router, tmp_path, PLAIN):
        for typed, state in (("n\n", "rejected"), ("y\n", "waiting")):
            added = ("goal", "add", ODD, "--id", state)
            said = await asyncio.to_thread(robotctl.at_terminal, typed, *added)
            data = (await robotctl.soon("goal", "show", state, "--json")).data["status"]
            assert PLAIN in said.err
            assert MEANING in said.err
            assert "Is that meant" in said.err
            assert (said.code == 0) == (state == "waiting")
            assert data["state"] == state


async def test_what_a_model_proposes_as_a_task_is_kept_by_whoever_wants_it(
    router: RouterProcess, robotctl: Robotctl, tmp_path: Path
) -> None:
    task = {
        "name": "do_the_usual",
        "says": ["do the usual for {where: place}"],
        "do": [["bring cup 1 to {where}"]],
    }
    async with fleet(router, tmp_path, PLAIN, task=task):
        await robotctl.soon("goal", "add", "Do the usual for the hallway", "--id", "g")
        page = (await robotctl.soon("goal", "show", "g")).out
        early = await robotctl.soon("task", "keep", "g", "mine.yaml")
        await robotctl.soon("goal", "answer", "g", "yes")
        kept = await robotctl.soon("task", "keep", "g", "mine.yaml")
        twice = await robotctl.soon("task", "keep", "g", "mine.yaml")
        await robotctl.soon("goal", "add", PLAIN, "--id", "h")
        none = await robotctl.soon("task", "keep", "h", "mine.yaml")
    assert "do the usual for {where: place}" in page
    assert early.code == 1
    assert "robotctl goal answer g yes" in early.err
    assert kept.code == 0, kept.err
    assert "do_the_usual" in kept.out
    assert "there is a task do_the_usual already" in twice.err
    assert "no language model has proposed a task for goal h" in none.err
    mine = str(tmp_path / "mine.yaml")
    async with (
        person(router.endpoint, cups=2),
        planner(router.endpoint, tmp_path / "planner", "--tasks", mine),
    ):
        said = await robotctl.soon("task", "explain", "do the usual for the living room")
    assert said.code == 0, said.err
    assert "at(cup_1) = living_room" in said.out
