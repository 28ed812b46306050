"""The page about traffic, from what was measured."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.traffic.arrivals import Outcome
from benchmarks.traffic.corridor import kept_s


def page(
    building: Sequence[Outcome],
    door: Sequence[Outcome],
    building_before: Sequence[Outcome],
    door_before: Sequence[Outcome],
    limit: float,
    corridor: float,
) -> str:
    """Markdown."""
    best = max(building, key=lambda row: row.per_minute)
    full = max(row.per_minute for row in door)
    kept, share = kept_s(0.6), best.per_minute / min(limit, corridor)
    return f"""<!-- Written by `python -m benchmarks.traffic.run --out docs/benchmarks`. -->

# Traffic

Robots of 0.5 m, at 0.6 m/s, in a building of eight rooms along a corridor of 2.4 m by 24 m, each
room with one door of 1 m. Whoever has arrived is sent to another room of chance, for
{building[0].seconds:g} simulated seconds, with three seeds. They are points that follow the
navigator's legs, half of them with two driven wheels. The last column depends on the machine, and
on what else it does.

![Arrivals by number of robots](traffic.png)

{_table(building, building_before)}

A door is full at {full:.1f} robots a minute, when both sides always want to get through:

{_table(door, door_before)}

Every trip is through two doors: eight doors let {limit:.0f} robots arrive in a minute. Each node of
the corridor is a robot's for {kept:.2f} s when it drives on: {corridor:.0f} could arrive in a
minute if no robot ever waited for another (a linear programme, `benchmarks/traffic/corridor.py`).
The most that was measured is {best.per_minute:.1f}, with {best.robots} robots, {share:.0%} of the
lower limit: for the rest of the time doors stand idle, and robots wait where their ways cross.

How it works is in [simulation.md](../simulation.md#traffic).
"""


def _table(rows: Sequence[Outcome], before: Sequence[Outcome]) -> str:
    old = {row.robots: row for row in before}
    lines = [
        "| robots | arrivals a minute | before | never arrived | legs failed | contacts "
        "| longest trip [s] | before | CPU for a simulated second [ms] |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for row in rows:
        was = old.get(row.robots)
        rate, longest = (f"{was.per_minute:.1f}", f"{was.longest_s:.0f}") if was else ("", "")
        lines.append(
            f"| {row.robots} | {row.per_minute:.1f} | {rate} | {row.never} | {row.failed} "
            f"| {row.contacts} | {row.longest_s:.0f} | {longest} | {1000 * row.cpu_s:.1f} |"
        )
    return "\n".join(lines)
