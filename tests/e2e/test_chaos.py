"""A few faults at once in a real fleet on three hosts, and what is promised of it."""

from __future__ import annotations

import asyncio
import re
import sys
from pathlib import Path

import pytest

from tests.support.child_process import child_process

pytestmark = [pytest.mark.e2e, pytest.mark.slow]

ROOT = Path(__file__).parents[2]
GUARANTEES = ROOT / "docs" / "guarantees.md"
LIMIT_S = 400.0


async def test_promises_hold_under_faults_at_once(tmp_path: Path) -> None:
    """`make chaos`, short: the faults that once broke a promise, a stop, and somebody who takes
    a goal back; of what cannot be had here it says so and does without."""
    command = (
        *("-m", "benchmarks.chaos.run", "--again", "--faults", "2", "--missions", "1"),
        *("--kinds", "stop", "cancel", "--seed", "15", "--folder", str(tmp_path / "chaos")),
    )
    async with child_process(sys.executable, *command, cwd=ROOT) as process:
        async with asyncio.timeout(LIMIT_S):
            out, errors = await process.communicate()
    said = out.decode()
    assert process.returncode == 0, said + errors.decode()
    assert "WRONG" not in said
    assert re.search(r"'confirmed writes': [1-9]", said)
    assert re.search(r"'values that agree': [1-9]", said)


def test_each_test_that_shows_a_promise_is_there() -> None:
    named = re.findall(r"`(tests/[\w/.]+)(?:::(\w+))?`", GUARANTEES.read_text(encoding="utf-8"))
    assert len(named) > 8
    for file, test in named:
        source = (ROOT / file).read_text(encoding="utf-8")
        assert not test or f"def {test}(" in source, f"{file} has no {test}"
