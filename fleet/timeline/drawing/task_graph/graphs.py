"""The task graphs: what waits for what, who does it, how it stands."""

from __future__ import annotations

from typing import Any

import rerun as rr

from fleet.timeline.drawing.palette import TASK_STATES, TITLE
from fleet.timeline.drawing.sink import Sink
from fleet.timeline.drawing.task_graph.layout import GAP_PX, GLYPH_PX, WIDEST_PX
from fleet.timeline.drawing.task_graph.revisions import TITLE_PX, Drawing, PlanDrawings
from keyexpr_schema.payloads.plans import Plan, PlanStatus
from keyexpr_schema.payloads.tasks import ENDED_TASKS, TaskRecord

PLANS = 6
"""At most so many revisions of plans are drawn: the latest."""


class _Page:
    """Where drawings stand: the revisions of a plan side by side, each plan below the last one."""

    def __init__(self) -> None:
        self.extent = (0.0, 0.0)
        self._plan = ""
        self._left = self._top = self._bottom = 0.0

    def corner(self, plan: str, size: tuple[float, float]) -> tuple[float, float]:
        """Left and top [px] of the next drawing, which is of that plan and so large."""
        if plan != self._plan or (self._left and self._left + size[0] > WIDEST_PX):
            self._plan, self._left, self._top = plan, 0.0, self._bottom
        corner = self._left, self._top
        self._left += size[0]
        self._bottom = max(self._bottom, self._top + size[1])
        self.extent = max(self.extent[0], self._left), self._bottom
        return corner


class Graphs:
    """Draws every plan, a graph for each of its revisions."""

    def __init__(self, sink: Sink) -> None:
        self._sink = sink
        self.extent = (0.0, 0.0)
        """How wide and how high [px] all that was ever shown is."""
        self.plans: dict[str, PlanDrawings] = {}

    def __len__(self) -> int:
        """How many plans and tasks are remembered."""
        return sum(
            1 + len(drawing.records) + len(drawing.shown_nodes)
            for plan in self.plans.values()
            for drawing in plan.revisions.values()
        )

    # --- what is known of plans ------------------------------------------------------------------
    def plan(self, plan: Plan, at_s: float) -> None:
        """A revision of a plan was made: what it still wants moves into its graph."""
        drawings = self._of(plan.plan)
        drawing = drawings.of(plan.revision)
        drawing.wanted = {task.task: task for task in plan.tasks}
        for older in drawings.revisions.values():
            if older.revision >= plan.revision:
                continue
            going = [
                task
                for task, record in older.records.items()
                if task in drawing.wanted and record.state not in ENDED_TASKS
            ]
            drawing.records |= {task: older.records.pop(task) for task in going}
        self._changed(drawings, at_s)
        while len(drawings.revisions) > PLANS:
            self._clear(drawings.revisions.pop(next(iter(drawings.revisions))), at_s)
            drawings.folded = True

    def status(self, plan: str, status: PlanStatus | None, at_s: float) -> None:
        """How a plan stands; `None`: nobody says so any more."""
        drawings = self._of(plan)
        drawings.status = status
        self._changed(drawings, at_s)

    def drop_plan(self, plan: str, at_s: float) -> None:
        """The plan was deleted; what is known of its tasks stays."""
        drawings = self._of(plan)
        for drawing in drawings.revisions.values():
            drawing.wanted = None
        self._changed(drawings, at_s)

    def record(self, record: TaskRecord, at_s: float) -> None:
        """How a task stands."""
        drawings = self._of(record.plan)
        drawing = drawings.home(record)
        if drawing is not None:
            drawing.records[record.task] = record
            _change(drawing, at_s)

    def drop_record(self, plan: str, task: str, at_s: float) -> None:
        """The record of a task was deleted."""
        for drawing in self._of(plan).revisions.values():
            if drawing.records.pop(task, None) is not None:
                _change(drawing, at_s)

    def forget(self, plan: str, now_s: float) -> None:
        """The plan is over and others came: draw it no more."""
        drawings = self.plans.pop(plan, None)
        for drawing in drawings.revisions.values() if drawings is not None else ():
            self._clear(drawing, now_s)

    # --- drawing ---------------------------------------------------------------------------------
    def draw(self, now_s: float, wall_s: float, final: bool = False) -> None:
        """Log the revisions that changed and may be drawn by `now_s` [s, fleet time]."""
        every = [(plan, row) for plan in self.plans.values() for row in plan.revisions.values()]
        if not any(d.dirty and (final or d.due(now_s, wall_s, p.over)) for p, d in every):
            return
        page = _Page()
        for at, (plan, drawing) in enumerate(every):
            at_s = min(now_s, max(drawing.changed_s, drawing.drawn_s)) if drawing.dirty else now_s
            if at < len(every) - PLANS:
                drawing.dirty = False
                self._clear(drawing, at_s)
                continue
            if drawing.dirty and (final or drawing.due(now_s, wall_s, plan.over)):
                drawing.dirty = False
                drawing.drawn_s, drawing.drawn_wall_s = now_s, wall_s
                drawing.arrange(drawing.nodes(plan.allocation), plan.title(drawing))
            else:
                at_s = now_s  # what is beside or above it may take more room, or less
            self._log(drawing, page.corner(plan.plan, drawing.size), at_s)
        self.extent = max(self.extent[0], page.extent[0]), max(self.extent[1], page.extent[1])

    def _of(self, plan: str) -> PlanDrawings:
        return self.plans.setdefault(plan, PlanDrawings(plan))

    @staticmethod
    def _changed(drawings: PlanDrawings, at_s: float) -> None:
        for drawing in drawings.revisions.values():
            _change(drawing, at_s)

    def _clear(self, drawing: Drawing, at_s: float) -> None:
        drawing.arrange([], "")
        self._log(drawing, (0.0, 0.0), at_s)

    def _log(self, drawing: Drawing, corner: tuple[float, float], at_s: float) -> None:
        nodes, title, (left, top) = drawing.shown_nodes, drawing.shown_title, corner
        if (nodes, title, corner) == drawing.drawn:
            return
        drawing.drawn = nodes, title, corner
        if not nodes:
            if drawing.edges_drawn is not None:
                drawing.edges_drawn = None
                self._sink.log(drawing.path, rr.Clear(recursive=False), at_s)
            return
        names = {node.task for node in nodes}
        edges = [(first, node.task) for node in nodes for first in node.after if first in names]
        places = [drawing.positions[node.task] for node in nodes]
        middle = left + (GLYPH_PX * len(title) + GAP_PX) / 2
        drawn: dict[str, list[Any]] = {
            "node_ids": [f"{drawing.plan} r{drawing.revision}", *(node.task for node in nodes)],
            "positions": [(middle, top), *((x + left, y + top + TITLE_PX) for x, y in places)],
            "labels": [title, *(node.label for node in nodes)],
            "colors": [TITLE, *(TASK_STATES[node.state] for node in nodes)],
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


def _change(drawing: Drawing, at_s: float) -> None:
    drawing.dirty = True
    drawing.changed_s = max(drawing.changed_s, at_s)
