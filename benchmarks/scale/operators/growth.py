"""What of a fleet grows with what it has lived through: slopes over the second half of a run.

In the first half things grow until their bounds: keys of 200 plans, the journals, what libraries
keep. What has no bound by design is left out: history, the audit log, and logs.
"""

from __future__ import annotations

from collections.abc import Sequence
from statistics import fmean, linear_regression

from benchmarks.scale.soak import Lived

FLAT_PERCENT = 5.0
"""What grows by less in a hundred missions counts as flat [% of its mean]."""
Series = list[tuple[int, float]]


def measured(lived: Sequence[Lived]) -> dict[str, Series]:
    """What is looked at, by name: mission and value."""
    found: dict[str, Series] = {}
    for name in ("planner", "router", "workers", "sim"):
        found[f"memory of {name}"] = [(one.mission, one.rss_mb[name]) for one in lived]
    for name in ("planner", "store", "workers"):
        found[f"files of {name}"] = [(one.mission, one.files_mb[name]) for one in lived]
    for name in ("planner", "router", "workers"):
        restarts = [(o.mission, o.restart) for o in lived if o.restart is not None]
        found[f"CPU of a start of {name}"] = [
            (mission, restart.cpu_s)
            for mission, restart in restarts
            if restart.name.startswith(name)
        ]
    return found


def growth_percent(series: Series) -> float | None:
    """By how much it grows in a hundred missions, of its mean [%], over the second half of them;
    `None` where there are not three values."""
    half = [] if not series else [each for each in series if each[0] >= series[-1][0] / 2]
    if len(half) < 3:
        return None
    missions, values = zip(*half, strict=True)
    return 1e4 * linear_regression(missions, values).slope / fmean(values)


def growth(lived: Sequence[Lived]) -> dict[str, float]:
    """`growth_percent` of all that is looked at."""
    found = {name: growth_percent(series) for name, series in measured(lived).items()}
    return {name: each for name, each in found.items() if each is not None}
