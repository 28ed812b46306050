"""Where the tasks of a graph stand: robots side by side, each task below all that it waits for."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Any

import networkx

from keyexpr_schema.ids import actor_in, natural_order
from keyexpr_schema.payloads.tasks import TaskState

ROW_PX = 58.0
GLYPH_PX = 7.0
GAP_PX = 40.0
WIDEST_PX = 1100.0
"""What is wider is hard to read: the rest stands below."""
WIDER_THAN_HIGH = 2.5
"""Of more than fills such a page the page becomes larger, and keeps about this shape."""


@dataclass(frozen=True)
class Node:
    """One task as it is drawn."""

    task: str
    label: str
    state: TaskState
    lane: str
    after: tuple[str, ...]


def width_of(node: Node) -> float:
    """How wide [px] a node is drawn."""
    return GLYPH_PX * max(map(len, node.label.split("\n")))


def shape_of(nodes: list[Node]) -> list[object]:
    """All of the nodes that their positions follow from."""
    return [(node.task, node.lane, node.after, width_of(node)) for node in nodes]


def layout(nodes: list[Node]) -> dict[str, tuple[float, float]]:
    """Positions `(x, y)` in the viewer's points: a column for each robot, one task in a row of it.
    Robots that wait for nobody else, and for which there is no room beside the others, stand below.

    A task stands below all that it waits for; so columns and rows stay readable where layers by
    depth alone would put a robot's independent tasks side by side. A dependency on itself, on an
    unknown task or around a cycle counts for nothing.
    """
    rank = _ranks({node.task: node.after for node in nodes})
    row: dict[str, int] = {}
    free: dict[str, int] = {}
    for node in sorted(nodes, key=lambda node: (rank[node.task], natural_order(node.task))):
        below = [row[first] + 1 for first in node.after if first in row]
        row[node.task] = max([free.get(node.lane, 0), *below])
        free[node.lane] = row[node.task] + 1
    positions: dict[str, tuple[float, float]] = {}
    left = top = low = 0.0
    widest = max(WIDEST_PX, sqrt(WIDER_THAN_HIGH * sum(map(width_of, nodes)) * ROW_PX))
    for lanes in _bands(nodes):
        mine = {lane: [node for node in nodes if node.lane == lane] for lane in lanes}
        wide = {lane: max(map(width_of, own)) + GAP_PX for lane, own in mine.items()}
        if left and left + sum(wide.values()) > widest:
            left, top = 0.0, low + ROW_PX
        for lane, own in mine.items():
            for node in own:
                y = top + row[node.task] * ROW_PX
                positions[node.task] = (left + wide[lane] / 2, y)
                low = max(low, y + 0.5 * ROW_PX)
            left += wide[lane]
    return positions


def _bands(nodes: list[Node]) -> list[list[str]]:
    """The lanes in their order; those of which one waits for another stay together."""
    lane = {node.task: node.lane for node in nodes}
    meet = networkx.Graph()
    meet.add_nodes_from(lane.values())
    meet.add_edges_from(
        (lane[first], node.lane) for node in nodes for first in node.after if first in lane
    )
    together = [sorted(lanes, key=_order) for lanes in networkx.connected_components(meet)]
    return sorted(together, key=lambda lanes: _order(lanes[0]))


def _order(lane: str) -> tuple[bool, Any]:
    """Robots first, then actors that no robot is allocated to."""
    return actor_in(lane) is not None, natural_order(lane)


def _ranks(after: dict[str, tuple[str, ...]]) -> dict[str, int]:
    """Longest path to each task, counted in tasks before it; those of a cycle count as one."""
    waits = networkx.DiGraph()
    waits.add_nodes_from(after)
    waits.add_edges_from(
        (before, task) for task, befores in after.items() for before in befores if before in after
    )
    whole = networkx.condensation(waits)
    return {
        task: rank
        for rank, generation in enumerate(networkx.topological_generations(whole))
        for component in generation
        for task in whole.nodes[component]["members"]
    }
