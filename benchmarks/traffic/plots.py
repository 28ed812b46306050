"""Arrivals over the number of robots, beside what the doors let through."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from benchmarks.traffic.arrivals import Outcome


def draw(path: Path, now: Sequence[Outcome], before: Sequence[Outcome], limit: float) -> None:
    """`limit` is how many can arrive in a minute if every door is always in use."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.2), layout="constrained")
    for rows, style, colour, label in ((before, "--", "C7", "before"), (now, "-", "C0", "now")):
        robots = [row.robots for row in rows]
        left.plot(robots, [row.per_minute for row in rows], style, marker="o", color=colour)
        right.plot(
            robots, [row.longest_s for row in rows], style, marker="o", color=colour, label=label
        )
    left.axhline(limit, color="C3", linestyle=":")
    left.text(5, limit - 3.5, "what eight doors let through", color="C3", fontsize=9)
    left.set_title("arrivals a minute")
    right.set_title("the longest trip [s]")
    for axis in (left, right):
        axis.set_xlabel("robots")
        axis.set_ylim(bottom=0)
        axis.spines[["top", "right"]].set_visible(False)
    right.legend(frameon=False)
    figure.savefig(path, dpi=130)
    plt.close(figure)
