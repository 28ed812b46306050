"""Tasks that goals can name, by robotctl with a real planner."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.planner_process import person, planner
from tests.support.robotctl import Robotctl
from tests.support.router_process import RouterProcess

OWN = """\
tasks:
  cup_round:
    about: Cups where people are.
    says: ["do a cup round to {place: place}"]
    methods:
      - needs: [9 cup]
        do: ["bring all cups to {place}"]
      - do: ["bring the first cup to {place}"]
  unicorns:
    says: look after the unicorns
    do: find the unicorn
"""
TEXT = "Do a cup round to the hallway"


@pytest.fixture
def robotctl(router: RouterProcess, tmp_path: Path) -> Robotctl:
    return Robotctl(router.endpoint, tmp_path, "test")


async def test_tasks_are_listed_explained_and_meant_by_goals(
    router: RouterProcess, robotctl: Robotctl, tmp_path: Path
) -> None:
    own = tmp_path / "own.yaml"
    own.write_text(OWN, encoding="utf-8")
    async with (
        person(router.endpoint, cups=2),
        planner(router.endpoint, tmp_path / "planner", "--tasks", str(own)),
    ):
        page = await robotctl.soon("tasks")
        known = (await robotctl.soon("tasks", "--json")).data
        told = await robotctl.soon("task", "explain", TEXT)
        explained = await robotctl.soon("task", "explain", TEXT, "--json")
        none = await robotctl.soon("task", "explain", "look after the unicorns", "--json")
        plain = await robotctl.soon("task", "explain", "bring cup 1 to the hallway")
        goals = (await robotctl.soon("goal", "list", "--json")).data
        goal = await robotctl.soon("goal", "add", TEXT, "--id", "g")
        row = (await robotctl.soon("goal", "show", "g", "--json")).data
        unknown = await robotctl.soon("goal", "add", "make pancakes")
    assert page.code == 0, page.err
    assert "do a cup round to" in page.out
    assert {"cup_round", "set_the_table"} <= {task["task"] for task in known}
    assert told.code == 0, told.err
    assert "passed over: it takes 9 cups, and there are only 2" in told.out
    assert "understood as at(cup_1) = hallway" in told.out
    assert explained.code == 0, explained.err
    data = explained.data
    (called,) = data["called"]
    assert [method["taken"] for method in called["methods"]] == [False, True]
    ((condition,),) = data["stages"]
    assert (condition["relation"], condition["subject"], condition["value"]) == (
        "at",
        "cup_1",
        "hallway",
    )
    assert none.code == 1, "a script need not look for what is not there"
    assert none.data["understood"] is None and not none.data["called"][0]["methods"][0]["taken"]
    assert "'look after the unicorns' cannot be done here: 'the unicorn'" in none.err
    assert "it calls no task by name" in plain.out
    assert goals == []
    assert goal.code == 0, goal.err
    assert "at(cup_1) = hallway" in goal.out
    assert "taken for: bring the first cup to the hallway." in row["status"]["note"]
    assert unknown.code == 1
    assert "nothing is known of 'make pancakes'; tasks known are" in unknown.err


async def test_a_file_that_is_wrong_keeps_the_planner_from_starting(
    router: RouterProcess, robotctl: Robotctl, tmp_path: Path
) -> None:
    own = tmp_path / "own.yaml"
    own.write_text("tasks: {tea: {says: make tea}}", encoding="utf-8")
    said = await robotctl.soon("planner", "--tasks", str(own), "--data", str(tmp_path / "p"))
    assert said.code == 1
    assert said.err == (
        f"Error: {own} line 1: task tea must say what it means: `do` (side by side) or `in_order` "
        "(one after the other), a list of sentences, and not both\n"
    )


async def test_without_a_planner_no_tasks_are_known(
    router: RouterProcess, robotctl: Robotctl
) -> None:
    said = await robotctl.soon("tasks")
    assert said.code == 1
    assert "no planner is running" in said.err
