"""`make fuzz`: many messages to one fleet after the other, and a mission for each afterwards."""

from __future__ import annotations

import argparse
import asyncio
import secrets
import sys
import tempfile
from pathlib import Path

from cli.errors import CliError
from tests.fuzz.fleet import TOGETHER, fuzzed_fleet


async def fuzz(seed: int, first: int, count: int, out: Path) -> None:
    """Send `count` messages of a run to a fleet of its own, whose logs lie in `out`."""
    async with fuzzed_fleet(out) as fleet:
        for begin in range(first, first + count, TOGETHER):
            numbers = range(begin, min(begin + TOGETHER, first + count))
            await fleet.send(seed, numbers)
        fleet.assert_all_up()
        await fleet.carry_out_a_mission()
        fleet.assert_all_up()
    print(f"{seed}/{first}..{first + count - 1}: all up, the goal is reached", flush=True)
    for name, log in fleet.logs.items():
        if "Traceback" in log:
            raise CliError(f"{name} has said a traceback: its log is in {out}")


def main() -> None:
    """Read the command line, and fuzz."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=100_000)
    parser.add_argument("--each", type=int, default=5_000, help="messages to one fleet")
    parser.add_argument("--seed", type=int, default=secrets.randbelow(10**6))
    parser.add_argument("--first", type=int, default=0)
    asked = parser.parse_args()
    print(f"seed {asked.seed}; --seed {asked.seed} --first N sends the same messages again")
    folder = Path(tempfile.mkdtemp(prefix="fuzz-"))
    print(f"logs are in {folder}")
    for begin in range(asked.first, asked.first + asked.count, asked.each):
        count = min(asked.each, asked.first + asked.count - begin)
        try:
            asyncio.run(fuzz(asked.seed, begin, count, folder / f"{begin}"))
        except (CliError, AssertionError) as error:
            sys.exit(f"\nerror: {error}")


if __name__ == "__main__":
    main()
