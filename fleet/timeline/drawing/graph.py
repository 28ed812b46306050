"""The task graph: what waits for what, who does it, how it stands. Robots stand side by side."""

from __future__ import annotations

from dataclasses import dataclass, field

import networkx
import rerun as rr

from fleet.timeline.drawing.gantt import call_text
from fleet.timeline.drawing.palette import TASK_STATES
from fleet.timeline.drawing.sink import Sink, entity
from fleet.timeline.drawing.text import drawable
from keyexpr_schema.ids import actor_in, natural_order
from keyexpr_schema.payloads.plans import Plan, PlanStatus, Task
from keyexpr_schema.payloads.tasks import TaskRecord, TaskState

ROW_PX = 58.0
GLYPH_PX = 7.0
GAP_PX = 40.0
PLANS = 6
"""At most so many plans are drawn, one below the other: the latest."""

EAGER = 60
"""Plans up to this many tasks are drawn at each change; larger ones every `tasks / 60` seconds."""

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
    drawn: object = None
    drawn_s: float = float("-inf")
    dirty: bool = False

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

    def of(self, plan: str) -> Drawing:
        """The drawing of a plan, marked for drawing again."""
        drawing = self.drawings.get(plan)
        if drawing is None:
            drawing = self.drawings[plan] = Drawing(entity("fleet", "dag", plan))
        drawing.dirty = True
        return drawing

    def draw(self, now_s: float, final: bool = False) -> None:
        """Log the plans that changed, at fleet time `now_s` [s]."""
        if not any(drawing.dirty for drawing in self.drawings.values()):
            return
        top = 0.0
        for at, drawing in enumerate(self.drawings.values()):
            if at < len(self.drawings) - PLANS:
                self._clear(drawing, now_s)
                continue
            nodes = drawing.nodes()
            positions = layout(nodes)
            depth = 1 + max((row for _, row in positions.values()), default=0.0) / ROW_PX
            big = len(nodes) > EAGER and not final
            late = now_s - drawing.drawn_s >= len(nodes) / EAGER or now_s < drawing.drawn_s
            if not big or late:
                self._log(
                    drawing, nodes, {t: (x, y + top) for t, (x, y) in positions.items()}, now_s
                )
            top += (depth + 0.5) * ROW_PX if nodes else 0.0

    def _log(
        self,
        drawing: Drawing,
        nodes: list[Node],
        positions: dict[str, tuple[float, float]],
        now_s: float,
    ) -> None:
        drawing.dirty = False
        now = (tuple(nodes), tuple(positions.items()))
        if now == drawing.drawn:
            return
        drawing.drawn, drawing.drawn_s = now, now_s
        if not nodes:
            self._sink.log(drawing.path, rr.Clear(recursive=False), now_s)
            return
        names = {node.task for node in nodes}
        edges = [(first, node.task) for node in nodes for first in node.after if first in names]
        drawn = rr.GraphNodes(
            node_ids=[node.task for node in nodes],
            positions=[positions[node.task] for node in nodes],
            labels=[node.label for node in nodes],
            colors=[TASK_STATES[node.state] for node in nodes],
            show_labels=True,
        )
        # One entity for both, or the viewer does not know which nodes the edges mean.
        edged = rr.GraphEdges(edges=edges, graph_type="directed")
        self._sink.log(drawing.path, drawn, now_s, None, edged)

    def _clear(self, drawing: Drawing, now_s: float) -> None:
        drawing.dirty = False
        if drawing.drawn is not None:
            drawing.drawn = None
            self._sink.log(drawing.path, rr.Clear(recursive=False), now_s)


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
