"""The key-space's writers and readers are those that a running fleet shows."""

from __future__ import annotations

import asyncio
import shlex
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest

from cli.demo.mission_run import DemoOptions, running_demo
from keyexpr_schema.key import Component
from keyexpr_schema.keyspace import GOAL_SPEC, KEY_TREES, KEYSPACE, UNDECODABLE
from keyexpr_schema.payloads.goals import GoalAddress
from keyexpr_schema.transport.trace import TRACE_VARIABLE
from tests.support.polling import until
from tests.support.robotctl import Robotctl

pytestmark = [pytest.mark.e2e, pytest.mark.slow]

KEYS = {key.name: key for key in KEYSPACE}
COMPONENTS = {
    "planner": Component.PLANNER,
    "worker": Component.WORKER,
    "sim": Component.SIMULATION,
    "recorder": Component.RECORDER,
    "store": Component.STORE,
    "robotctl": Component.PERSON,
}
"""By the name that a session goes by, up to the first hyphen."""

WRITES = {"put", "delete", "token", "query"}
"""The others read: whoever serves a query key reads the queries."""

NOT_WRITTEN = {
    # Who cannot read a value says so; here nothing of that kind is for workers or the simulation.
    "reject": Component.WORKER | Component.SIMULATION,
    "diagnostic": Component.PLANNER | Component.RECORDER,
    # Nothing is deployed here.
    "deployment": Component.PERSON,
    # Nor is there a certificate.
    "revocations": Component.PERSON,
}
NOT_READ = {
    # A worker that comes back looks up what it reported last.
    "report": Component.OWN_WORKER,
    "revocations": Component.ANYONE,
}
"""What the table allows, and this mission has no need of."""

IN_TROUBLE = {"diagnostic", "report"}
"""Of these, what is not needed while all is well: where a link is lost for a moment, it is."""

STORE_QUESTIONS = {key.name for key in KEYSPACE if key.readers == Component.STORE}
"""What every process may ask the store; which of them has to, depends on the moment."""

OVER = {key.name for tree in KEY_TREES for key in tree.keys}
"""What the planner deletes, whoever wrote it, when it is over."""

PLAN = """
goals: []
conditions: []
tasks:
  - {task: t1, skill: navigate, args: {robot: "?a1", to: kitchen}, actor: a1}
"""


@pytest.fixture(scope="module")
def trace(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[str, str, str, str]]:
    """Component, operation, name of the key and key expression of all that a mission does."""
    folder = tmp_path_factory.mktemp("trace")
    file = folder / "trace.txt"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(TRACE_VARIABLE, str(file))
        asyncio.run(mission(folder))
    lines = (line.split(" ") for line in file.read_text(encoding="utf-8").splitlines())
    return [(name, operation, key, at) for name, operation, key, at in lines]


async def mission(folder: Path) -> None:
    """Two cups are brought; then a person looks at everything, proposes a plan, deletes, asks."""
    options = DemoOptions("two-cups", folder / "run", backend="kinematic", apart=True)
    (folder / "plan.yaml").write_text(f"plan: mine{PLAN}", encoding="utf-8")

    async with running_demo(options) as demo:
        robotctl = Robotctl(demo.processes.endpoint, folder, demo.processes.realm)
        robotctl.env[TRACE_VARIABLE] = str(folder / "trace.txt")

        async def play() -> None:
            await demo.submit()
            await demo.wait_until_ended()
            key, link = GOAL_SPEC.build(GoalAddress("bad")), demo.session.link
            link.send_soon(key, b"{", "application/json", block=True)

            async def unread() -> bool:
                found = {address.component for address in await demo.session.list(UNDECODABLE)}
                return found == {"planner", "recorder", "robotctl"}

            await until(unread, "all who read goals to say that they cannot read this one")
            for words in (
                "status",
                "health",
                "health planner",
                "health recorder",
                "health sim",
                'goal add "Search the hallway" --every "0 8 * * 1-5" --id daily',
                "schedule list",
                "schedule pause daily",
                "schedule delete daily",
                "durations",
                "robots",
                "goal list",
                "plan list",
                "task show plan-1 t1",
                "tasks",
                "world list",
                "world add --fact at cup_1 kitchen",
                "world delete at cup_1",
                "plan propose plan.yaml --no-start",
                "plan delete mine",
                "stop --all --wait 60",
                "resume --robot hsr",
                "resume --all",
                "drain hsr",
                "return hsr",
                "unregister hsr --wait 60",
                "world close kitchen_door",
                "world open --all",
                "history",
                "audit",
                "history stats",
            ):
                done = await robotctl.soon(*shlex.split(words))
                assert done.code == 0, (words, done.err)
            asked = await robotctl.soon("ask", "Where is the first cup?")
            assert asked.code == 0, asked.err
            refused = await robotctl.soon("replan", "plan-1")
            assert "not running" in refused.err
            for words in ("goal delete --ended", "plan delete --ended"):
                done = await robotctl.soon(*words.split())
                assert "deleted" in done.out, (words, done.err)

        await demo.processes.guard(play())


def allowed(column: Component, name: str, key: str, at: str) -> bool:
    """Whether a column of the table has the component that goes by this name."""
    kind, _, robot = name.partition("-")
    if COMPONENTS[kind] in column:
        return True
    chunks = dict(zip(KEYS[key].template.split("/"), at.split("/"), strict=True))
    return kind == "worker" and Component.OWN_WORKER in column and chunks["{robot}"] == robot


def column(key: str, operation: str) -> Component:
    return KEYS[key].writers if operation in WRITES else KEYS[key].readers


def test_nothing_is_done_that_the_table_does_not_allow(
    trace: list[tuple[str, str, str, str]],
) -> None:
    assert [
        (name, operation, at)
        for name, operation, key, at in trace
        if not (operation == "delete" and name == "planner" and key in OVER)
        and not allowed(column(key, operation), name, key, at)
    ] == []


def test_all_that_the_table_says_is_done_but_for_what_is_named_here(
    trace: list[tuple[str, str, str, str]],
) -> None:
    written: dict[str, Component] = defaultdict(lambda: Component(0))
    read: dict[str, Component] = defaultdict(lambda: Component(0))
    for name, operation, key, _ in trace:
        seen = written if operation in WRITES else read
        seen[key] |= as_in_the_table(column(key, operation), name)
    unwritten = unless_in_trouble(dict(missing(written, "writers")), NOT_WRITTEN)
    unasked = {name: unwritten.pop(name, Component(0)) for name in STORE_QUESTIONS}
    assert unwritten == NOT_WRITTEN
    assert [name for name, left in unasked.items() if left == KEYS[name].writers] == []
    assert unless_in_trouble(dict(missing(read, "readers")), NOT_READ) == NOT_READ


def unless_in_trouble(
    found: dict[str, Component], named: dict[str, Component]
) -> dict[str, Component]:
    """`found`, as it is where nobody has been in trouble."""
    expected = {name: named[name] for name in IN_TROUBLE & named.keys()}
    less = {name: all_ for name, all_ in expected.items() if found.get(name, all_) in all_}
    return found | less


def as_in_the_table(column: Component, name: str) -> Component:
    component = COMPONENTS[name.partition("-")[0]]
    if component is Component.WORKER and Component.OWN_WORKER in column:
        return Component.OWN_WORKER
    return component


def missing(seen: dict[str, Component], side: str) -> Iterator[tuple[str, Component]]:
    for key in KEYSPACE:
        if left := getattr(key, side) & ~seen[key.name]:
            yield key.name, left
