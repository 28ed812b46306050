"""The task graph: what waits for what, who does it, how it stands. Robots stand side by side."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import networkx
import rerun as rr

from fleet.timeline.drawing.gantt import call_text
from fleet.timeline.drawing.palette import TASK_STATES
from fleet.timeline.drawing.sink import Sink, entity
from fleet.timeline.drawing.text import drawable
from keyexpr_schema.ids import actor_in, natural_order
from keyexpr_schema.payloads.plans import ENDED_PLANS, Plan, PlanStatus, Task
from keyexpr_schema.payloads.tasks import TaskRecord, TaskState

ROW_PX = 58.0
GLYPH_PX = 7.0
GAP_PX = 40.0
PLANS = 6
"""At most so many plans are drawn, one below the other: the latest."""

STEP_S = 0.5
"""A plan is drawn again after so much of the fleet's time and of wall time at the earliest: a
simulation may run fast. What ended is drawn at once."""

EAGER = 120
"""Plans of more than 60 tasks wait `tasks / 120` seconds instead."""

GLYPHS = {
    TaskState.WAITING: "…",
    TaskState.ORDERED: "→",
    TaskState.RUNNING: "▶",
    TaskState.SUCCEEDED: "✔",
    TaskState.FAILED: "✗",
    TaskState.CANCELLED: "∅",
}


@dataclass(frozen=True)
class Node:
    """One task as it is drawn."""

    task: str
    label: str
    state: TaskState
    lane: str
    after: tuple[str, ...]


@dataclass
class Drawing:
    """What is known of one plan, and what of it was last drawn."""

    path: str
    plan: Plan | None = None
    status: PlanStatus | None = None
    records: dict[str, TaskRecord] = field(default_factory=dict)
    nodes_drawn: list[Node] = field(default_factory=list)
    top_drawn: float = 0.0
    positions: dict[str, tuple[float, float]] = field(default_factory=dict)
    """Of `nodes_drawn`, from 0 down."""
    edges_drawn: list[tuple[str, str]] | None = None
    """None while nothing is shown."""
    drawn_s: float = float("-inf")
    drawn_wall_s: float = float("-inf")
    changed_s: float = float("-inf")
    dirty: bool = False

    @property
    def height(self) -> float:
        """How much room [px] it takes as it was last drawn."""
        if not self.positions:
            return 0.0
        return max(y for _, y in self.positions.values()) + 1.5 * ROW_PX

    @property
    def over(self) -> bool:
        """Whether nothing of it goes on."""
        return self.status is not None and self.status.state in ENDED_PLANS

    def due(self, now_s: float, wall_s: float) -> bool:
        """Whether it changed, and was drawn long enough ago."""
        if not self.dirty:
            return False
        pause_s = max(STEP_S, len(self.nodes_drawn) / EAGER)
        late = now_s - self.drawn_s >= pause_s and wall_s - self.drawn_wall_s >= STEP_S
        return self.over or late or now_s < self.drawn_s or wall_s < self.drawn_wall_s

    def nodes(self) -> list[Node]:
        """The tasks of the plan's latest revision, and what was done or runs from older ones."""
        wanted = {task.task: task for task in self.plan.tasks} if self.plan else {}
        revision = self.plan.revision if self.plan else 0
        nodes = []
        for name, task in wanted.items():
            if name in self.records:
                continue
            robot = self.status.allocation.get(task.actor) if self.status else None
            nodes.append(_node(task, robot, TaskState.WAITING, task.after))
        for name, record in self.records.items():
            kept = record.state in (TaskState.SUCCEEDED, TaskState.RUNNING)
            if name not in wanted and record.revision < revision and not kept:
                continue
            after = (*(wanted[name].after if name in wanted else record.after), *record.behind)
            nodes.append(_node(record, record.robot, record.state, after))
        return nodes


class Graphs:
    """Draws every plan, the latest below."""

    def __init__(self, sink: Sink) -> None:
        self._sink = sink
        self.drawings: dict[str, Drawing] = {}

    def __len__(self) -> int:
        """How many plans and tasks are remembered."""
        return sum(1 + len(d.records) + len(d.nodes_drawn) for d in self.drawings.values())

    def of(self, plan: str, at_s: float) -> Drawing:
        """The drawing of a plan, marked for drawing again: something changed at `at_s` [s]."""
        drawing = self.drawings.get(plan)
        if drawing is None:
            drawing = self.drawings[plan] = Drawing(entity("fleet", "dag", plan))
        drawing.dirty = True
        drawing.changed_s = max(drawing.changed_s, at_s)
        return drawing

    def forget(self, plan: str, now_s: float) -> None:
        """The plan is over and others came: draw it no more."""
        drawing = self.drawings.pop(plan, None)
        if drawing is not None:
            self._log(drawing, [], 0.0, now_s)

    def draw(self, now_s: float, wall_s: float, final: bool = False) -> None:
        """Log the plans that changed and may be drawn by `now_s` [s, fleet time]."""
        if not any(d.dirty and (final or d.due(now_s, wall_s)) for d in self.drawings.values()):
            return
        top = 0.0
        for at, drawing in enumerate(self.drawings.values()):
            at_s = min(now_s, max(drawing.changed_s, drawing.drawn_s)) if drawing.dirty else now_s
            if at < len(self.drawings) - PLANS:
                drawing.dirty = False
                self._log(drawing, [], 0.0, at_s)
                continue
            if drawing.dirty and (final or drawing.due(now_s, wall_s)):
                drawing.dirty = False
                drawing.drawn_s, drawing.drawn_wall_s = now_s, wall_s
                self._log(drawing, drawing.nodes(), top, at_s)
            elif drawing.top_drawn != top:  # what is above it takes more room, or less
                self._log(drawing, drawing.nodes_drawn, top, now_s)
            top += drawing.height

    def _log(self, drawing: Drawing, nodes: list[Node], top: float, at_s: float) -> None:
        if nodes == drawing.nodes_drawn and top == drawing.top_drawn:
            return
        if _shape(nodes) != _shape(drawing.nodes_drawn):
            drawing.positions = layout(nodes)
        drawing.nodes_drawn, drawing.top_drawn = nodes, top
        if not nodes:
            if drawing.edges_drawn is not None:
                drawing.edges_drawn = None
                self._sink.log(drawing.path, rr.Clear(recursive=False), at_s)
            return
        names = {node.task for node in nodes}
        edges = [(first, node.task) for node in nodes for first in node.after if first in names]
        places = [drawing.positions[node.task] for node in nodes]
        drawn: dict[str, list[Any]] = {
            "node_ids": [node.task for node in nodes],
            "positions": [(x, y + top) for x, y in places],
            "labels": [node.label for node in nodes],
            "colors": [TASK_STATES[node.state] for node in nodes],
        }
        # One entity for both, or the viewer does not know which nodes the edges mean.
        if drawing.edges_drawn is None:
            edged = rr.GraphEdges(edges=edges, graph_type="directed")
            self._sink.log(
                drawing.path, rr.GraphNodes(**drawn, show_labels=True), at_s, None, edged
            )
        else:
            self._sink.row(drawing.path, rr.GraphNodes, at_s, None, **drawn)
            if edges != drawing.edges_drawn:
                self._sink.row(drawing.path, rr.GraphEdges, at_s, None, edges=edges)
        drawing.edges_drawn = edges


def _shape(nodes: list[Node]) -> list[object]:
    """All of the nodes that their positions follow from."""
    return [
        (node.task, node.lane, node.after, max(map(len, node.label.split("\n")))) for node in nodes
    ]


def layout(nodes: list[Node]) -> dict[str, tuple[float, float]]:
    """Positions `(x, y)` in the viewer's points: a column for each robot, one task in a row of it.

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
    left = 0.0
    for lane in sorted(free, key=lambda lane: (actor_in(lane) is not None, natural_order(lane))):
        mine = [node for node in nodes if node.lane == lane]
        width = max(GLYPH_PX * len(line) for node in mine for line in node.label.split("\n"))
        width += GAP_PX
        for node in mine:
            positions[node.task] = (left + width / 2, row[node.task] * ROW_PX)
        left += width
    return positions


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


def _node(
    task: Task | TaskRecord, robot: str | None, state: TaskState, after: tuple[str, ...]
) -> Node:
    lane = robot or f"?{task.actor}"
    what = call_text(task.skill, task.args, robot)
    label = drawable(f"{GLYPHS[state]} {task.task}: {what}\n{lane} · {state.value}")
    return Node(task=task.task, label=label, state=state, lane=lane, after=after)
