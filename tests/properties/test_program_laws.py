"""Laws of the sandbox: whatever text a program is, it ends soon, by a sentence or by returning, and
calls nothing but what it was given."""

from __future__ import annotations

import asyncio
from typing import Any

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.support.polling import DEADLINE_S
from tests.support.reached import Reached, reaches
from workers import HOUSEHOLD, ProgramRefused, ProgramStopped, SkillFailed
from workers.programs.sandbox import Call, Limits, run_sandboxed
from workers.programs.stubs import CALLS, callable_skills, stubs_of

STUBS = stubs_of(HOUSEHOLD)
SKILLS = frozenset(callable_skills(HOUSEHOLD))
KNOWN = {*CALLS, *SKILLS}
QUICK = Limits(calls=30, between_calls_s=0.2, in_all_s=0.5, memory_bytes=16 * 2**20)

atoms = st.sampled_from(
    ['"cup_1"', '"kitchen"', "3", "None", "x", "[]", "10 ** 9", "ask('at', x)", "f(x)", "str(x)"]
)
WRAPS = ["[{}] * 9", "not {}", "({}, 1)", "{}[0]", "len({})"]
expressions = st.recursive(
    atoms,
    lambda inner: st.one_of(
        st.tuples(inner, st.sampled_from(["+", "*", "==", "and", "or", "%"]), inner).map(" ".join),
        st.tuples(
            st.sampled_from(["[{}] * 9", "not {}", "({}, 1)", "{}[0]", "len({})"]), inner
        ).map(lambda made: made[0].format(made[1])),
    ),
    max_leaves=4,
)
simple = st.one_of(
    expressions.map("x = {}".format),
    expressions.map("print({})".format),
    expressions.map("pick(str({}), 'kitchen')".format),
    expressions.map("learn('n', 'cup_1', str({}))".format),
    st.sampled_from(
        [
            "navigate(to='kitchen')",
            "import os\nos.getcwd()",
            "from pathlib import Path\nPath('/').exists()",
            "import asyncio\nasyncio.run(asyncio.sleep(9))",
            "fly()",
            "fail('no')",
            "raise KeyError(x)",
            "x = x + x",
            "del x",
            "eval('pick(1, 2)')",
            "exec('import os')",
            "global x",
            "break",
        ]
    ),
)
HEADS = [
    "for n in range(10 ** 6):",
    "while True:",
    "if x:",
    "try:",
    "def f(x: object) -> object:",
    "class X:",
]


def indented(made: tuple[str, list[str]]) -> str:
    head, body = made
    text = head + "\n" + "\n".join("    " + line for s in body for line in s.split("\n"))
    return text + ("\nexcept BaseException:\n    pass" if head == "try:" else "")


statements = st.recursive(
    simple,
    lambda inner: st.tuples(st.sampled_from(HEADS), st.lists(inner, min_size=1, max_size=3)).map(
        indented
    ),
    max_leaves=6,
)
plain = st.sampled_from(
    ["navigate(to='kitchen')", "pick('cup_1', 'kitchen')", "learn('n', 'cup_1', 'x')", "x = ''"]
)
programs = st.one_of(
    st.lists(plain, min_size=1, max_size=4).map("\n".join),
    st.lists(statements, min_size=1, max_size=5).map(lambda made: "x = ''\n" + "\n".join(made)),
    st.text(max_size=200),
)


@reaches("ran", "refused", "stopped", "called", "failed call")
@settings(max_examples=150, deadline=None, suppress_health_check=list(HealthCheck))
@given(code=programs, fails=st.booleans())
def test_a_program_ends_and_calls_only_what_it_may(
    code: str, fails: bool, reached: Reached
) -> None:
    calls: list[Call] = []

    async def answer(call: Call) -> Any:
        calls.append(call)
        reached["called"] += 1
        if fails and call.name in SKILLS:
            reached["failed call"] += 1
            raise SkillFailed("no")
        return "kitchen" if call.name == "ask" else None

    async def run() -> None:
        # Only a sandbox that hangs comes to this.
        async with asyncio.timeout(DEADLINE_S):
            await run_sandboxed(code, STUBS, answer, QUICK)

    try:
        asyncio.run(run())
        reached["ran"] += 1
    except ProgramRefused as refused:
        reached["refused"] += 1
        assert not calls and "\n" not in str(refused)
    except ProgramStopped as stopped:
        reached["stopped"] += 1
        assert str(stopped) and "\n" not in str(stopped)
    assert len(calls) <= QUICK.calls
    assert {call.name for call in calls} <= KNOWN | {"f"}
