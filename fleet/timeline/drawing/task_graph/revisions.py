"""What is drawn of one plan: a graph for each of its revisions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from fleet.timeline.drawing.gantt import call_text
from fleet.timeline.drawing.sink import entity
from fleet.timeline.drawing.task_graph.layout import (
    GAP_PX,
    GLYPH_PX,
    ROW_PX,
    Node,
    layout,
    shape_of,
    width_of,
)
from fleet.timeline.drawing.text import drawable
from keyexpr_schema.payloads.plans import ENDED_PLANS, PlanStatus, Task
from keyexpr_schema.payloads.tasks import TaskRecord, TaskState

TITLE_PX = 50.0
"""From the title of a graph to its first tasks."""

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


@dataclass
class Drawing:
    """What is known of one revision of a plan, and what of it was last drawn.

    A revision that another one replaced keeps what was done in it, and what still ends there.
    """

    path: str
    plan: str
    revision: int
    wanted: dict[str, Task] | None = None
    replaced: bool = False
    records: dict[str, TaskRecord] = field(default_factory=dict)
    shown_nodes: list[Node] = field(default_factory=list)
    shown_title: str = ""
    positions: dict[str, tuple[float, float]] = field(default_factory=dict)
    """Of `shown_nodes`, from 0 to the right and down."""
    size: tuple[float, float] = (0.0, 0.0)
    """How wide and how high [px] it is with its title."""
    drawn: object = None
    """What was last handed to the viewer, and where it stood."""
    edges_drawn: list[tuple[str, str]] | None = None
    """None while nothing is shown."""
    drawn_s: float = float("-inf")
    drawn_wall_s: float = float("-inf")
    changed_s: float = float("-inf")
    dirty: bool = False

    def arrange(self, nodes: list[Node], title: str) -> None:
        """These nodes are to be shown: where they stand follows."""
        if shape_of(nodes) != shape_of(self.shown_nodes):
            self.positions = layout(nodes)
        self.shown_nodes, self.shown_title = nodes, title
        self.size = (0.0, 0.0)
        if nodes:
            right = [self.positions[node.task][0] + width_of(node) / 2 for node in nodes]
            low = max(y for _, y in self.positions.values())
            wide = max(*right, GLYPH_PX * len(title)) + GAP_PX
            self.size = wide, TITLE_PX + low + 1.5 * ROW_PX

    def due(self, now_s: float, wall_s: float, over: bool) -> bool:
        """Whether it changed, and was drawn long enough ago, or is of a plan that is over."""
        if not self.dirty:
            return False
        pause_s = max(STEP_S, len(self.shown_nodes) / EAGER)
        late = now_s - self.drawn_s >= pause_s and wall_s - self.drawn_wall_s >= STEP_S
        return over or late or now_s < self.drawn_s or wall_s < self.drawn_wall_s

    def nodes(self, allocation: Mapping[str, str]) -> list[Node]:
        """What is to be done, and what was done or runs."""
        wanted = {} if self.replaced else self.wanted or {}
        nodes = [
            _node(task, allocation.get(task.actor), TaskState.WAITING, task.after)
            for name, task in wanted.items()
            if name not in self.records
        ]
        for name, record in self.records.items():
            if self.replaced and record.state in (TaskState.WAITING, TaskState.ORDERED):
                continue
            after = (*(wanted[name].after if name in wanted else record.after), *record.behind)
            nodes.append(_node(record, record.robot, record.state, after))
        return nodes


@dataclass
class PlanDrawings:
    """The revisions of a plan that are drawn, and how the plan stands."""

    plan: str
    status: PlanStatus | None = None
    revisions: dict[int, Drawing] = field(default_factory=dict)
    folded: bool = False
    """Whether there were older revisions than those."""

    @property
    def over(self) -> bool:
        """Whether nothing of it goes on."""
        return self.status is not None and self.status.state in ENDED_PLANS

    @property
    def allocation(self) -> Mapping[str, str]:
        """The robots of its actors, as far as that is decided."""
        return self.status.allocation if self.status else {}

    def title(self, drawing: Drawing) -> str:
        """What stands above the graph of a revision."""
        words = [self.plan]
        if drawing.revision > 1 or drawing.replaced:
            words.append(f"revision {drawing.revision}")
        if drawing.replaced:
            words.append("replaced")
        elif self.status is not None:
            words.append(self.status.state.value)
        return drawable(" · ".join(words))

    def of(self, revision: int) -> Drawing:
        """The drawing of a revision; one that is older than others is replaced."""
        drawing = self.revisions.get(revision)
        if drawing is None:
            path = entity("fleet", "dag", self.plan, str(revision))
            drawing = self.revisions[revision] = Drawing(path, self.plan, revision)
            self.revisions = dict(sorted(self.revisions.items()))
            for other in list(self.revisions.values())[:-1]:
                other.replaced = other.dirty = True
        return drawing

    def home(self, record: TaskRecord) -> Drawing | None:
        """Where a task belongs: to the newest revision that wants it, or to its own; `None` if that
        is drawn no more."""
        for drawing in reversed(self.revisions.values()):
            if drawing.wanted is not None and record.task in drawing.wanted:
                return drawing
        if self.revisions and record.revision < next(iter(self.revisions)) and self.folded:
            return None
        return self.of(record.revision)


def _node(
    task: Task | TaskRecord, robot: str | None, state: TaskState, after: tuple[str, ...]
) -> Node:
    lane = robot or f"?{task.actor}"
    what = call_text(task.skill, task.args, robot)
    label = drawable(f"{GLYPHS[state]} {task.task}: {what}\n{lane} · {state.value}")
    return Node(task=task.task, label=label, state=state, lane=lane, after=after)
