"""What nobody should put, put on every key of real processes: all stay up, and go on."""

from __future__ import annotations

import os
import secrets
from pathlib import Path

import pytest

from tests.fuzz.fleet import TOGETHER, fuzzed_fleet

pytestmark = [pytest.mark.e2e]
MESSAGES = 2_000


async def test_odd_values_on_every_key_end_no_process_and_no_mission(tmp_path: Path) -> None:
    """`make fuzz` sends many more. CI sends the same each time; people send new ones."""
    seed = 12 if os.environ.get("CI") else secrets.randbelow(10**6)
    print(f"the seed is {seed}: python -m tests.fuzz.run --count {MESSAGES} --seed {seed}")
    async with fuzzed_fleet(tmp_path / "run") as fleet:
        for begin in range(0, MESSAGES, TOGETHER):
            await fleet.send(seed, range(begin, begin + TOGETHER))
        fleet.assert_all_up()
        await fleet.carry_out_a_mission()
        fleet.assert_all_up()
        assert [name for name, log in fleet.logs.items() if "Traceback" in log] == []
