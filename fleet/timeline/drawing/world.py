"""The 3D world: a static room, one transform a moving body, trails, labels."""

from __future__ import annotations

from collections import deque
from math import cos, sin

import rerun as rr

from fleet.timeline.drawing.palette import CLOSED, ONE_AT_A_TIME, WORDS, Palette, Rgba
from fleet.timeline.drawing.poses import Poses
from fleet.timeline.drawing.shapes import Bounds, log_shapes
from fleet.timeline.drawing.sink import Sink, entity
from fleet.timeline.drawing.text import drawable
from fleet.timeline.drawing.trails import Trail
from keyexpr_schema.payloads.closures import Closure
from keyexpr_schema.payloads.robots import RobotSpec, RobotState
from keyexpr_schema.payloads.simulation import Body, Frame, Scene, Shape, ShapeKind
from keyexpr_schema.payloads.world import Place

FRAME_STEP_S = 0.05
"""Frames closer together than this [s, fleet time] are thinned out: 20 a second look smooth."""

FEW = 12
"""Of more robots only what holds them back stands over them: words would hide each other."""

CHARGE_STEP = 5
"""Of the charge [%] that stands over a robot: finer steps would be many labels."""

EARLY = 400
"""So many frames, the latest, wait for the scene that says which bodies they are of."""

LABEL_M = 0.6
"""How far over a robot its label hangs: seen from above, a lower one hides its arm."""

ROBOT_TRAIL_M = 0.025
OBJECT_TRAIL_M = 0.015

_STAND_IN_M = (0.2, 0.5)  # radius, height of a robot that no scene describes


class World:
    """Draws scenes, frames, places and robots. All lengths in metres, world frame."""

    def __init__(self, sink: Sink, palette: Palette) -> None:
        self._sink = sink
        self._palette = palette
        self._bodies: dict[str, Body] = {}
        self.poses = Poses(sink)
        self._roots: dict[str, str] = {}  # owner -> the body that stands for it
        self._specs: dict[str, RobotSpec] = {}
        self._trails: dict[str, Trail] = {}
        self._labels: dict[str, tuple[str, float, str]] = {}
        """Of each robot the path, the height and the text of its label."""
        self._doing: dict[str, str | None] = {}
        self._held: dict[str, str] = {}
        self._charge: dict[str, int] = {}
        self._stand_ins: set[str] = set()
        self._tints: dict[str, int] = {}
        self._frame_s: float | None = None
        self._scene: Scene | None = None
        self._early: deque[tuple[Frame, float]] = deque(maxlen=EARLY)
        self._heights: dict[str, float] = {}
        self.bounds = Bounds()

    # --- what is there -----------------------------------------------------------------------
    def scene(self, scene: Scene) -> None:
        """Draw the fixed bodies and the shapes of the moving ones."""
        if scene == self._scene:
            return
        self.poses.flush()
        self._scene = scene
        self._bodies = {body.body: body for body in scene.bodies}
        self.poses.clear()
        self._roots.clear()
        for body in scene.bodies:
            fixed = scene.fixed.get(body.body)
            if fixed is not None:
                path = entity("world", "room", body.body)
                point, (w, x, y, z) = fixed
                self._sink.fix(
                    path,
                    rr.Transform3D(translation=point, quaternion=rr.Quaternion(xyzw=[x, y, z, w])),
                )
                self.bounds.add(point, body.shapes)
            else:
                path = entity("world", "bodies", body.owner or "world", body.body)
                if body.owner is not None:
                    self._roots.setdefault(body.owner, body.body)
            log_shapes(self._sink, path, body.shapes)
        for robot in sorted(self._stand_ins & self._roots.keys()):
            self._stand_ins.discard(robot)
            path = entity("world", "robots", robot)
            self._sink.log(path, rr.Clear(recursive=True), self._sink.clock.now_s)
        self._relabel()
        early, self._early = self._early, deque(maxlen=EARLY)
        for frame, wall_s in early:
            self.frame(frame, wall_s)

    def place(self, place: Place) -> None:
        """Tint the floor of a place and write its name on it."""
        boxes = [
            ((a + c) / 2, (b + d) / 2, abs(c - a) / 2, abs(d - b) / 2)
            for a, b, c, d in place.region_m
        ]
        path = entity("world", "places", place.place)
        if not boxes:
            return
        tint = _TINTS[self._tints.setdefault(place.place, len(self._tints)) % len(_TINTS)]
        self._sink.fix(
            path,
            rr.Boxes3D(
                centers=[(x, y, 0.004) for x, y, _, _ in boxes],
                half_sizes=[
                    (max(0.01, w - 0.05), max(0.01, h - 0.05), 0.002) for _, _, w, h in boxes
                ],
                colors=[tint] * len(boxes),
                fill_mode=rr.components.FillMode.Solid,
            ),
        )
        for x, y, w, h in boxes:
            self.bounds.cover(x - w, y - h)
            self.bounds.cover(x + w, y + h)
        x, y, _, h = max(boxes, key=lambda box: box[2] * box[3])
        self._sink.fix(
            f"{path}/name",
            rr.Points3D(
                [(x, y - 0.6 * h, 0.02)],
                radii=[0.001],
                colors=[(200, 200, 200, 255)],
                labels=[drawable(place.label)],
                show_labels=True,
            ),
        )

    def robot(self, spec: RobotSpec) -> None:
        """A robot by that name belongs to the fleet."""
        self._specs[spec.robot] = spec
        if spec.robot in self._trails:
            self._trails[spec.robot].become(self._palette.robot(spec.robot), ROBOT_TRAIL_M)
        self._relabel()

    # --- where it is -------------------------------------------------------------------------
    def frame(self, frame: Frame, wall_s: float) -> None:
        """Take the poses of a frame; bodies that did not move cost nothing."""
        if self._scene is None:
            self._early.append((frame, wall_s))
            return
        last = self._frame_s
        if last is not None and 0.0 <= frame.time_s - last < FRAME_STEP_S * 0.99:
            return
        self._frame_s = frame.time_s
        for name, pose in frame.poses.items():
            body = self._bodies.get(name)
            owner = (body.owner if body else None) or "world"
            self.poses.take(name, owner, pose, frame.time_s, wall_s)
        for owner, root in self._roots.items():
            there = frame.poses.get(root)
            if there is not None:
                self._trail(owner).visit(self._sink, there[0], frame.time_s, wall_s)
        if last is None:  # now it is known how high the robots are
            self._relabel()

    def state(self, state: RobotState, sim_s: float, wall_s: float) -> None:
        """Show how full its battery is, and a robot that no scene describes where it says it is."""
        if state.charge is not None:
            charge = round(state.charge / CHARGE_STEP) * CHARGE_STEP
            if self._charge.get(state.robot) != charge:
                self._charge[state.robot] = charge
                self.robot_label(state.robot, self._doing.get(state.robot), sim_s, wall_s)
        if state.pose_m_rad is None or state.robot in self._roots:
            return
        x, y, yaw = state.pose_m_rad
        radius, height = _STAND_IN_M
        path = entity("world", "robots", state.robot)
        if state.robot not in self._stand_ins:
            self._stand_ins.add(state.robot)
            body = rr.Cylinders3D(
                lengths=[height],
                radii=[radius],
                centers=[(0, 0, height / 2)],
                colors=[self._palette.robot(state.robot)],
                fill_mode=rr.components.FillMode.Solid,
            )
            self._sink.log(f"{path}/body", body, sim_s, wall_s)
            self.robot_label(state.robot, self._doing.get(state.robot), sim_s, wall_s)
        turned = (0.0, 0.0, sin(yaw / 2), cos(yaw / 2))  # x y z w
        self._sink.row(
            path, rr.Transform3D, sim_s, wall_s, translation=(x, y, 0.0), quaternion=turned
        )
        self._trail(state.robot).visit(self._sink, (x, y, 0.05), sim_s, wall_s)

    def robot_label(
        self, robot: str, doing: str | None, sim_s: float, wall_s: float | None
    ) -> None:
        """Write over the robot what it is called, and what it does (`None`: nothing)."""
        self._doing[robot] = doing
        root = self._roots.get(robot)
        if root is None and robot not in self._stand_ins:
            return  # its pose is not known
        path = entity("world", "bodies", robot, root) if root else entity("world", "robots", robot)
        spec = self._specs.get(robot)
        many = len(self._specs) > FEW
        name = robot if many else _called(robot, spec)
        if (charge := self._charge.get(robot, 100)) < 100:
            name = f"{name} {charge} %"
        words = ", ".join(filter(None, (self._held.get(robot), None if many else doing)))
        text = drawable(f"{name}: {words}" if words else name)
        height = self._height(robot) if root else _STAND_IN_M[1]
        before = self._labels.get(robot)
        now = self._labels[robot] = (path, height, text)
        if before is not None and before[:2] == now[:2]:
            if before != now:
                self._sink.row(f"{path}/label", rr.Points3D, sim_s, wall_s, labels=text)
            return
        self._sink.log(
            f"{path}/label",
            rr.Points3D(
                [(0, 0, height + LABEL_M)],
                radii=[0.001],
                colors=[self._palette.robot(robot)],
                labels=[text],
                show_labels=True,
            ),
            sim_s,
            wall_s,
        )

    def robot_held(self, robot: str, words: str | None, sim_s: float) -> None:
        """Write over the robot what holds it back (`None`: nothing any more)."""
        if words is None:
            self._held.pop(robot, None)
        else:
            self._held[robot] = words
        self.robot_label(robot, self._doing.get(robot), sim_s, None)

    def closure(self, closure: Closure, sim_s: float, wall_s: float | None) -> None:
        """Cover what is closed, and write on it for whom and why."""
        path = entity("world", "closures", closure.closure)
        if not closure.region_m:
            return
        boxes = [
            ((a + c) / 2, (b + d) / 2, abs(c - a) / 2, abs(d - b) / 2)
            for a, b, c, d in closure.region_m
        ]
        tint = ONE_AT_A_TIME if closure.one_at_a_time else CLOSED
        floor = rr.Boxes3D(
            centers=[(x, y, 0.02) for x, y, _, _ in boxes],
            half_sizes=[(max(0.05, w), max(0.05, h), 0.004) for _, _, w, h in boxes],
            colors=[tint] * len(boxes),
            fill_mode=rr.components.FillMode.Solid,
        )
        self._sink.log(path, floor, sim_s, wall_s)
        x, y, _, _ = boxes[0]
        said = rr.Points3D(
            [(x, y, 0.05)],
            radii=[0.001],
            colors=[WORDS],
            labels=[drawable(str(closure))],
            show_labels=True,
        )
        self._sink.log(f"{path}/name", said, sim_s, wall_s)

    def open_again(self, closure: str, sim_s: float) -> None:
        """It is closed no more."""
        self._sink.log(entity("world", "closures", closure), rr.Clear(recursive=True), sim_s)

    def _relabel(self) -> None:
        for robot in self._specs:
            self.robot_label(robot, self._doing.get(robot), self._sink.clock.now_s, None)

    # --- inside --------------------------------------------------------------------------------
    def _trail(self, owner: str) -> Trail:
        trail = self._trails.get(owner)
        if trail is None:
            robot = owner in self._specs or owner not in self._roots
            colour = self._palette.robot(owner) if robot else self._own_colour(owner)
            trail = Trail(
                entity("world", "trails", owner), colour, ROBOT_TRAIL_M if robot else OBJECT_TRAIL_M
            )
            self._trails[owner] = trail
        return trail

    def _own_colour(self, owner: str) -> Rgba:
        body = self._bodies.get(self._roots.get(owner, ""))
        if body is None or not body.shapes:
            return self._palette.robot(owner)
        r, g, b, _ = (round(255 * min(1.0, max(0.0, part))) for part in body.shapes[0].rgba)
        return (r, g, b, 255)

    def _height(self, robot: str) -> float:
        """Height [m] of a robot's highest shape over its root, as far as its frames tell."""
        root = self.poses.last(self._roots.get(robot, ""))
        base = root[0][2] if root is not None else 0.0
        tops = [0.3]
        for name, body in self._bodies.items():
            pose = self.poses.last(name)
            if body.owner == robot and pose is not None:
                tops.append(pose[0][2] - base + max(map(_top, body.shapes), default=0.0))
        # Kept from one call to the next, or the label would dance with the arm.
        self._heights[robot] = max(self._heights.get(robot, 0.0), *tops)
        return self._heights[robot]


def _called(robot: str, spec: RobotSpec | None) -> str:
    """A robot's id, and its label where that says more: those of a kind may have the same label."""
    label = spec.label if spec is not None else ""
    plain = label.casefold().replace(" ", "_")
    known = spec is None or plain == spec.model.casefold() or plain in robot.casefold()
    return robot if known else f"{robot} ({label})"


def _top(shape: Shape) -> float:
    """How high a shape reaches over its body's origin, m, if the body stands upright."""
    a, b, c = shape.size_m
    half = {ShapeKind.BOX: c, ShapeKind.CYLINDER: b, ShapeKind.SPHERE: a}.get(shape.kind, a + b)
    return shape.point_m[2] + half


_TINTS: tuple[Rgba, ...] = (
    (92, 84, 66, 255),
    (66, 80, 96, 255),
    (70, 90, 72, 255),
    (90, 70, 88, 255),
    (78, 78, 82, 255),
)
"""Floors of places, in the order in which those come."""
