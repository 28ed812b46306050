"""Which hosts, routers and links the shipped layouts have; `docs/pictures/router-layouts.png`.

`python -m benchmarks.figures.router_layouts`. Routers' links are those of `configs/routers/`.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from keyexpr_schema.endpoints import host_of
from keyexpr_schema.transport.zenoh_file import read_zenoh_file

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ROOT = Path(__file__).parents[2]
ROUTERS = ROOT / "configs" / "routers"
WIDTH, GAP = 2.6, 0.9


@dataclass(frozen=True)
class HostBox:
    """A host, the configuration of its router, and what runs there besides."""

    name: str
    file: str
    store: bool
    processes: tuple[str, ...]


LAYOUTS: dict[str, tuple[HostBox, ...]] = {
    "one host": (
        HostBox("one host", "one-host.json5", True, ("planner", "recorder", "workers", "robotctl")),
    ),
    "an office with two floors": (
        HostBox(
            "ground-floor", "office/ground-floor.json5", True, ("planner", "recorder", "workers")
        ),
        HostBox("first floor", "office/first-floor.json5", False, ("workers", "robotctl")),
    ),
    "a site and a cloud": (
        HostBox("site", "site-and-cloud/site.json5", True, ("planner", "recorder", "workers")),
        HostBox("cloud", "site-and-cloud/cloud.json5", False, ("robotctl",)),
    ),
    "a robot with a router of its own": (
        HostBox("site", "office/ground-floor.json5", True, ("planner", "recorder", "robotctl")),
        HostBox("robot", "robot.json5", False, ("worker",)),
    ),
}


def draw(path: Path) -> None:
    """Write the picture."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(2, 2, figsize=(11, 6.2), layout="constrained")
    for axis, (title, boxes) in zip(axes.flat, LAYOUTS.items(), strict=True):
        axis.set_title(title, loc="left", fontsize=11, fontweight="bold")
        axis.set_xlim(-0.1, 2 * WIDTH + GAP + 0.1)
        axis.set_ylim(0, 2.9)
        axis.set_aspect("equal")
        axis.axis("off")
        at = {box.name: number * (WIDTH + GAP) for number, box in enumerate(boxes)}
        for box in boxes:
            _host(axis, box, at[box.name])
        for box in boxes:
            for other in filter(None, map(host_of, _links(box))):
                _link(axis, at[box.name], at[other])
    figure.savefig(path, dpi=120)
    plt.close(figure)


def _links(box: HostBox) -> tuple[str, ...]:
    return read_zenoh_file(ROUTERS / box.file).connects("router")


def _host(axis: Axes, box: HostBox, left: float) -> None:
    from matplotlib.patches import FancyBboxPatch

    def rectangle(x: float, y: float, wide: float, high: float, colour: str, edge: str) -> None:
        axis.add_patch(
            FancyBboxPatch(
                (x, y),
                wide,
                high,
                boxstyle="round,pad=0,rounding_size=0.08",
                facecolor=colour,
                edgecolor=edge,
            )
        )

    rectangle(left, 0.05, WIDTH, 2.7, "#f6f8fa", "#8c959f")
    axis.text(left + 0.12, 2.5, box.name, fontsize=10, va="center")
    axis.text(left + 0.12, 0.2, box.file, fontsize=7.5, color="#57606a", va="center")
    rectangle(left + 0.2, 1.75, WIDTH - 0.4, 0.5, "#0969da" if box.store else "#54aeff", "none")
    label = "router with the store" if box.store else "router"
    axis.text(left + WIDTH / 2, 2.0, label, ha="center", va="center", color="white", fontsize=9)
    step = (WIDTH - 0.4) / len(box.processes)
    for number, name in enumerate(box.processes):
        x = left + 0.2 + number * step
        rectangle(x + 0.03, 0.55, step - 0.06, 0.45, "white", "#8c959f")
        axis.text(x + step / 2, 0.775, name, ha="center", va="center", fontsize=7)
        axis.plot([x + step / 2] * 2, [1.0, 1.75], color="#8c959f", linewidth=1)


def _link(axis: Axes, near: float, far: float) -> None:
    """An arrow from the router that connects to the one that listens."""
    to_right = far > near
    start = near + (WIDTH - 0.2 if to_right else 0.2)
    end = far + (0.2 if to_right else WIDTH - 0.2)
    axis.annotate(
        "",
        xy=(end, 2.0),
        xytext=(start, 2.0),
        arrowprops={"arrowstyle": "-|>", "color": "#0969da", "linewidth": 1.8},
    )
    axis.text((start + end) / 2, 2.1, "connects", ha="center", fontsize=8, color="#0969da")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--out", type=Path, default=ROOT / "docs" / "pictures" / "router-layouts.png"
    )
    draw(parser.parse_args().out)
