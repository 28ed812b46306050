"""The sandbox: whatever a program's text says, it ends, by one sentence, and touches nothing."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from tests.support.polling import DEADLINE_S
from workers import HOUSEHOLD, ProgramRefused, ProgramStopped, SkillFailed
from workers.programs.sandbox import Call, Limits, run_sandboxed
from workers.programs.stubs import stubs_of

STUBS = stubs_of(HOUSEHOLD)
SMALL = Limits(calls=50, between_calls_s=DEADLINE_S, in_all_s=DEADLINE_S, memory_bytes=32 * 2**20)
QUICK = replace(SMALL, between_calls_s=0.5)


async def run(code: str, answer: Any = None, limits: Limits = SMALL) -> list[Call]:
    calls: list[Call] = []

    async def noted(call: Call) -> Any:
        calls.append(call)
        return None if answer is None else answer(call)

    await run_sandboxed(code, STUBS, noted, limits)
    return calls


async def test_a_program_calls_skills_and_hears_what_they_give():
    code = """
for room in ("kitchen", "hallway"):
    if ask("at", "cup_1") == room:
        pick("cup_1", place=room)
"""
    calls = await run(code, lambda call: "hallway" if call.name == "ask" else None)
    assert [(c.name, c.args, c.kwargs, c.line) for c in calls] == [
        ("ask", ("at", "cup_1"), {}, 3),
        ("ask", ("at", "cup_1"), {}, 3),
        ("pick", ("cup_1",), {"place": "hallway"}, 4),
    ]


async def test_a_failed_call_can_be_caught():
    def answer(call: Call) -> None:
        if call.name == "pick":
            raise SkillFailed("the hand slipped")

    code = """
try:
    pick("cup_1", "kitchen")
except RuntimeError as why:
    replan(f"without it: {why}")
"""
    calls = await run(code, answer)
    assert calls[-1].args == ("without it: the hand slipped",)


REFUSED = {
    "import os\nos.system('ls')": "line 2: Module `os` has no member `system`",
    "import socket": "line 1: .*socket",
    "import subprocess\nsubprocess.run(['ls'])": "line 1: .*subprocess",
    "fly(to='kitchen')": "line 1: Name `fly` used when not defined",
    "pick(3, 'kitchen')": "line 1: .*Expected `str`, found `Literal\\[3\\]`",
    "pick('cup_1')": "line 1: No argument provided for required parameter `place`",
    "open('/etc/passwd').read()": "line 1: ",
    "x = = 3": "line 1: Expected an expression",
    "x = " + "(" * 5000 + ")" * 5000: "too deeply nested",
    "": "the program is empty",
    "pass\n" * 10_000: "50000 characters; 32000 are allowed",
    "pick('\ud800', 'kitchen')": "not Unicode",
}


@pytest.mark.parametrize("code", REFUSED, ids=range(len(REFUSED)))
async def test_what_does_not_pass_the_checks_is_refused_before_it_runs(code):
    with pytest.raises(ProgramRefused, match=REFUSED[code]) as refused:
        await run(code, lambda call: pytest.fail("something moved"))
    assert "\n" not in str(refused.value)


STOPPED = {
    "while True:\n    pass": "longer than 0.5 s",
    "try:\n    while True:\n        pass\nexcept BaseException:\n    pass\nwhile True:\n    pass": (
        "longer than 0.5 s"
    ),
    "x = [0] * 10**9": "more than 32 MiB of memory",
    "x = []\nwhile True:\n    x.append('a' * 10**6)": "more than 32 MiB of memory",
    "while True:\n    print('x' * 10_000)": "printed too much",
    "print('x' * 10_000)\nprint('x' * 10_000)\nask('at', 'cup_1')": "printed too much",
    "for n in range(10**6):\n    ask('at', 'cup_1')": "it made more than 50 calls",
    "while True:\n    try:\n        ask('at', 'x')\n    except BaseException:\n        pass": (
        "it made more than 50 calls"
    ),
    "def f(n: int) -> int:\n    return f(n + 1)\nf(1)": "more than 200 levels deep",
    "import time\ntime.sleep(100)": "line 2: a program has no time.sleep",
    "import datetime\ndatetime.datetime.now()": "line 2: a program has no datetime.now",
    "from pathlib import Path\nPath('/etc/passwd').read_text()": "no Path.read_text",
    "import os\nprint(os.environ)": "a program has no os.environ",
    "raise ValueError('boo')": "line 1: ValueError: boo",
    "raise ValueError('boo\\x1b[31m')": r"line 1: ValueError: boo \[31m$",
    "print([].__class__.__base__)": "line 1: AttributeError",
}


@pytest.mark.parametrize("code", STOPPED, ids=range(len(STOPPED)))
async def test_what_breaks_a_limit_is_stopped_with_a_sentence(code):
    limits = QUICK if "longer than" in STOPPED[code] else SMALL  # else time is not the point
    with pytest.raises(ProgramStopped, match=STOPPED[code]) as stopped:
        await run(code, limits=limits)
    assert "\n" not in str(stopped.value)


async def test_chance_is_the_same_every_time():
    code = "import random\nlearn('n', 'x', random.random())"
    first, again = await run(code), await run(code)
    assert first[0].args == again[0].args


async def test_what_an_answer_raises_ends_the_program():
    class Over(Exception):
        pass

    def answer(call: Call) -> None:
        raise Over

    with pytest.raises(Over):
        await run("try:\n    fail('x')\nexcept BaseException:\n    pass\npick('a', 'b')", answer)
