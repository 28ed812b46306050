"""Plans in files, by robotctl with a real planner: seen, edited, checked, proposed, compared."""

from __future__ import annotations

import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import msgspec
import pytest
import yaml

from cli.plans.files import read_plan, write_plan
from keyexpr_schema.keyspace import (
    ANSWER,
    GOAL_STATUS,
    PLAN_PROPOSAL,
    PLAN_SPEC,
    PLAN_STATUS,
    TASK_RECORD,
)
from keyexpr_schema.payloads.goals import GoalAddress, GoalState
from keyexpr_schema.payloads.plans import Plan, PlanAddress, Task
from keyexpr_schema.transport.session import Session
from tests.support.planner_process import carry_out, next_order, person, planner, value
from tests.support.polling import until
from tests.support.robotctl import Finished, Robotctl
from tests.support.router_process import RouterProcess

CONFIGS = Path(__file__).parents[3] / "configs"
WORLD = str(CONFIGS / "worlds" / "home.yaml")
HSR = str(CONFIGS / "robots" / "hsr.yaml")
LOCOBOT = str(CONFIGS / "robots" / "locobot.yaml")
TEXT = "Bring cup 1 to the hallway"


@pytest.fixture
def robotctl(router: RouterProcess, tmp_path: Path) -> Robotctl:
    return Robotctl(router.endpoint, tmp_path, "test")


@asynccontextmanager
async def fleet(router: RouterProcess, data: Path, *options: str) -> AsyncIterator[Session]:
    """A household with a manipulator that the test plays, and a planner."""
    async with person(router.endpoint) as session, planner(router.endpoint, data, *options):
        yield session


async def shown_at_last(robotctl: Robotctl, *options: str) -> Finished:
    """A dry run, as soon as the planner has seen the robot."""

    async def done() -> Finished | None:
        said = await robotctl.soon("plan", "create", "big-dag", "milp", "--dry-run", *options)
        assert said.code == 0 or said.err == "Error: no robot is connected\n"
        return said if said.code == 0 else None

    found: Finished = await until(done, "the planner to see the robot")
    return found


async def dry_run(robotctl: Robotctl, out: Path) -> Plan:
    """The planner's own plan for a goal that is told here, in a file."""
    await robotctl.soon("goal", "add", TEXT, "--id", "g")
    await shown_at_last(robotctl, "--out", str(out))
    return read_plan(out)


async def test_a_dry_run_shows_the_plan_and_leaves_nothing_behind(
    router: RouterProcess, robotctl: Robotctl, tmp_path: Path
) -> None:
    out = tmp_path / "plan.yaml"
    async with fleet(router, tmp_path / "planner") as session:
        await robotctl.soon("goal", "add", TEXT, "--id", "g")
        shown = await shown_at_last(robotctl)
        told = await robotctl.soon(
            "plan", "create", "big-dag", "milp", "g", "--dry-run", "--json", "--out", str(out)
        )
        refused = await robotctl.soon("plan", "create", "big-dag", "milp", "--out", str(out))
        flag = "--fallback-round-robin"
        turns = await robotctl.soon("plan", "create", "big-dag", "milp", "g", "--dry-run", flag)
        misplaced = await robotctl.soon("plan", "create", "big-dag", "makespan", flag)
        answers = await session.list(ANSWER)
        left = [
            *await session.list(PLAN_SPEC),
            *await session.list(PLAN_STATUS),
            *await session.list(TASK_RECORD),
        ]
        status = await session.get(GOAL_STATUS, GoalAddress("g"))
    assert shown.code == 0
    assert "“Bring cup 1 to the hallway”" in shown.out
    assert "pick(object=cup_1, place=kitchen)" in shown.out
    assert "makespan" in shown.out
    plan = msgspec.convert(told.data["preview"], Plan)
    assert [task.skill for task in plan.tasks] == ["navigate", "pick", "navigate", "place"]
    assert set(told.data["preview_status"]["allocation"].values()) == {"hsr"}
    assert told.data["preview_status"]["predicted_makespan_s"] > 0.0
    assert read_plan(out) == plan
    assert left == []
    assert status is not None
    assert status.state is GoalState.WAITING
    assert len(answers) == 3
    assert turns.code == 0 and "milp-or-round-robin" in turns.out
    assert misplaced.code == 1 and "goes with the allocator milp" in misplaced.err
    assert "--out goes with --dry-run" in refused.err


async def test_a_plan_is_edited_checked_and_proposed(
    router: RouterProcess, robotctl: Robotctl, tmp_path: Path
) -> None:
    out = tmp_path / "plan.yaml"
    async with fleet(router, tmp_path / "planner") as session:
        plan = await dry_run(robotctl, out)
        good = await robotctl.soon("plan", "check", str(out))
        connected = await robotctl.soon("plan", "check", str(out), "--connected", "--json")

        wrong = msgspec.structs.replace(plan, plan="mine", tasks=plan.tasks[:1] + plan.tasks[2:])
        write_plan(tmp_path / "wrong.json", wrong)
        bad = await robotctl.soon("plan", "check", str(tmp_path / "wrong.json"))
        bad_json = await robotctl.soon("plan", "check", str(tmp_path / "wrong.json"), "--json")
        rejected = await robotctl.soon("plan", "propose", str(tmp_path / "wrong.json"))
        after_rejection = await robotctl.soon("plan", "show", "mine")

        ready = await robotctl.soon(
            "plan", "propose", str(out), "--id", "yours", "--no-start", "--json"
        )
        again = await robotctl.soon("plan", "propose", str(out), "--id", "yours")
        yours = PlanAddress("yours")
        proposal = await session.get(PLAN_PROPOSAL, yours)
        await robotctl.soon("plan", "delete", "yours")
        assert await session.get(PLAN_PROPOSAL, yours) is None
        runs = await robotctl.soon("plan", "propose", str(out), "--id", "ours")
        order = await next_order(session, set())
    assert good.code == 0, good.err
    assert "is valid: 4 tasks, 1 actor, for hsr" in good.out
    assert (connected.code, connected.data) == (0, [])
    assert bad.code == 1
    assert "condition" in bad.out
    sentences = [violation["sentence"] for violation in bad_json.data]
    assert bad_json.code == 1
    assert sentences
    assert all(sentence in bad.out for sentence in sentences)
    assert all(violation["code"] for violation in bad_json.data)
    assert rejected.code == 1
    assert rejected.err.startswith("Error: plan mine is rejected: ")
    assert sentences[0] in rejected.err
    assert "rejected" in after_rejection.out
    assert sentences[0] in after_rejection.out
    assert ready.code == 0, ready.err
    assert ready.data["status"]["state"] == "ready"
    assert ready.data["plan"]["autostart"] is False
    assert proposal is not None
    assert proposal.tasks == plan.tasks
    assert "there is a plan yours already" in again.err
    assert "plan ours is running" in runs.out
    assert (order.plan, order.skill) == ("ours", "navigate")


async def test_plans_and_their_revisions_are_compared(
    router: RouterProcess, robotctl: Robotctl, tmp_path: Path
) -> None:
    out = tmp_path / "plan.yaml"
    async with fleet(router, tmp_path / "planner") as session:
        await dry_run(robotctl, out)
        made = await robotctl.soon("goal", "add", TEXT, "--id", "g2", "--plan", "--json")
        plan = made.data["status"]["plan"]
        await carry_out(session, await next_order(session, set()))
        await value(session, PLAN_STATUS, PlanAddress(plan), revision=1)
        await next_order(session, {"t1"})
        same = await robotctl.soon("plan", "diff", str(out), plan, "--json")
        # Somebody has carried the cup away: it has to be fetched elsewhere.
        await robotctl.soon("world", "add", "--fact", "at", "cup_1", "living_room")
        await value(session, PLAN_STATUS, PlanAddress(plan), revision=2)
        changed = await robotctl.soon("plan", "diff", f"{plan}@1", f"{plan}@2", "--json")
        text = await robotctl.soon("plan", "diff", f"{plan}@1", plan)
        files = await robotctl.soon("plan", "diff", str(out), str(out))
        missing = await robotctl.soon("plan", "diff", f"{plan}@1", f"{plan}@7")
        unknown = await robotctl.soon("plan", "diff", "nothing@1", plan)
        page = (await robotctl.soon("plan", "show", plan)).out
    assert made.code == 0, made.err
    assert same.code == 0, same.err
    assert [each["task"] for each in same.data["kept"]] == ["t1", "t2", "t3", "t4"]
    assert same.data["changed"] == same.data["dropped"] == same.data["added"] == []
    assert changed.code == 0, changed.err
    assert [task["task"] for task in changed.data["finished"]] == ["t1"]
    calls = {
        change["field"]: (change["before"], change["now"])
        for each in changed.data["changed"]
        for change in each["changes"]
    }
    gone = {task["skill"]: task["args"] for task in changed.data["dropped"]}
    new = {task["skill"]: task["args"] for task in changed.data["added"]}
    assert calls.get("args.place") == ("kitchen", "living_room") or (
        gone["pick"]["place"],
        new["pick"]["place"],
    ) == ("kitchen", "living_room")
    assert f"{plan}@1 → {plan}: " in text.out
    assert "1 finished meanwhile" in text.out
    assert "4 kept, 0 changed, 0 dropped, 0 added" in " ".join(files.out.split())
    assert f"plan {plan} has no revision 7; known are: 1, 2" in missing.err
    assert "there is no plan 'nothing'" in unknown.err
    assert "change      revision 2 kept " in page


def test_a_plan_is_checked_against_files_without_any_fleet(
    tmp_path: Path,
) -> None:
    nobody = Robotctl("tcp/127.0.0.1:1", tmp_path)
    file = tmp_path / "plan.yaml"
    task = Task(
        task="t1",
        skill="navigate",
        args={"robot": "?a1", "to": "kitchen"},
        actor="a1",
    )
    pick = Task(
        task="t2",
        skill="pick",
        args={"robot": "?a1", "object": "cup_1", "place": "kitchen"},
        actor="a1",
        after=("t1",),
    )
    write_plan(file, Plan(plan="p", goals=(), conditions=(), tasks=(task, pick)))
    here = ("plan", "check", str(file), "--world", WORLD, "--robots", HSR, "--robots", LOCOBOT)

    known = nobody(*here, "--fact", "at", "cup_1", "kitchen")
    assert known.code == 0, known.err
    assert nobody(*here, "--fact", "at(cup_1) = kitchen", "--json").data == []
    unknown = nobody(*here, "--json")
    assert unknown.code == 1
    assert [(each["code"], each["task"]) for each in unknown.data] == [("condition-unmet", "t2")]
    assert nobody(*here[:5], "--robots", LOCOBOT, "--fact", "at cup_1 kitchen").code == 1
    assert "did you mean 'kitchen'" in nobody(*here, "--fact", "at", "cup_1", "kitchn").err
    assert "is RELATION SUBJECT VALUE" in nobody(*here, "--fact", "at", "cup_1").err
    assert "--robots and --fact go with --world" in nobody(*here[:3], "--fact", "a b c").err
    assert "name who could do it" in nobody(*here[:5]).err


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ("tasks: [", "is not YAML"),
        ("- 1", "a plan is a list of `name: value` lines"),
        ("plan: p", "it lacks the field `goals`"),
        ({"tasks": [{"task": "t1", "skill": "x"}]}, "tasks[0]: it lacks the field"),
        ({"tasks": 3}, "tasks: expected a list, got a whole number"),
        ({"plan": "a b"}, "plan: expected a name (1 to 63"),
        ({"taks": []}, "taks: there is no such field; valid are: plan, "),
        (
            {"tasks": [{"task": "t", "skill": "s", "args": {}, "actor": "a", "afer": []}]},
            "tasks[0].afer: there is no such field; valid are: task,",
        ),
    ],
)
def test_a_file_that_is_no_plan_is_one_sentence(tmp_path: Path, data: Any, words: str) -> None:
    file = tmp_path / "plan.yaml"
    if not isinstance(data, str):
        plan = {"plan": "p", "goals": [], "conditions": [], "tasks": [], **data}
        data = json.dumps(plan) if len(words) % 2 else yaml.safe_dump(plan)
    file.write_text(data)
    said = Robotctl("tcp/127.0.0.1:1", tmp_path)("plan", "check", str(file))
    assert said.code == 1
    assert said.out == ""
    assert said.err.startswith("Error: ")
    assert str(file) in said.err
    assert words in said.err
    assert said.err.count("\n") == 1
