"""What nobody should put, put on every key of real processes: all stay up, and go on."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.fuzz.fleet import TOGETHER, fuzzed_fleet

pytestmark = [pytest.mark.e2e]
MESSAGES = 2_000
SEED = 12


async def test_odd_values_on_every_key_end_no_process_and_no_mission(tmp_path: Path) -> None:
    """The same messages each time; `make fuzz` sends new ones, and many more."""
    async with fuzzed_fleet(tmp_path / "run") as fleet:
        for begin in range(0, MESSAGES, TOGETHER):
            await fleet.send(SEED, range(begin, begin + TOGETHER))
        fleet.assert_all_up()
        await fleet.carry_out_a_mission()
        fleet.assert_all_up()
        assert [name for name, log in fleet.logs.items() if "Traceback" in log] == []
