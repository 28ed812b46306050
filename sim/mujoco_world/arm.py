"""An arm and its hand: where the joints must be, getting them there, and what the fingers feel."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from sim.mujoco_world.base_controllers import PERIOD_S
from sim.mujoco_world.description import ArmEntry, GripperEntry

ITERATIONS = 60
DAMPING = 1e-3
POINT_TOLERANCE_M = 0.002
AXIS_TOLERANCE_RAD = 0.02
TOUCH_N = 0.3
"""Least force on a pad that counts as touching; a cup of 0.1 kg held by friction needs more."""

STANDS_1_S = 0.02
"""A joint slower than this, in rad/s or m/s, does not move."""

FINGER_SPEED_M_S = 0.10
CLOSED_M = 0.003
"""Fingers nearer to the middle than this hold nothing."""

WAY_STEPS = 8
"""At so many points on its way it is looked whether an arm touches something."""


class Arm:
    """Follows `goal` (joint values) at the joints' own speeds, all arriving together."""

    def __init__(self, model: Any, data: Any, prefix: str, entry: ArmEntry) -> None:
        import mujoco

        self.entry = entry
        self._model, self._data = model, data
        self._scratch = mujoco.MjData(model)
        joints = [model.joint(prefix + name) for name in entry.joints]
        self._qpos = [int(joint.qposadr[0]) for joint in joints]
        self._dofs = [int(joint.dofadr[0]) for joint in joints]
        self._limits = [tuple(float(v) for v in joint.range) for joint in joints]
        self._ctrl = [int(model.actuator(prefix + name).id) for name in entry.actuators]
        self._site = int(model.site(prefix + entry.grip_site).id)
        self._robot_root = int(model.body_rootid[model.site_bodyid[self._site]])
        root = model.body_rootid[model.geom_bodyid]
        self._links = (root == self._robot_root).nonzero()[0]
        self._stow = list(entry.stow)
        self.setpoint = list(entry.stow)
        self.goal = list(entry.stow)
        self.slowness = 1.0
        """How many times slower than its own speeds the arm moves."""
        self.imagined: Callable[[Any], None] | None = None
        """Puts base and fingers, in the data it is given, where they are taken to be."""

    def put_stowed(self) -> None:
        """Start folded (before the simulation runs)."""
        self._data.qpos[self._qpos] = self.entry.stow

    def grip_point(self) -> tuple[float, float, float]:
        """Where the middle between the finger pads is, world frame."""
        x, y, z = (float(v) for v in self._data.site_xpos[self._site])
        return (x, y, z)

    def freeze(self) -> None:
        """Stay as it is."""
        self.goal = list(self.setpoint)

    def commanded(self) -> bool:
        """Whether the setpoints have come to the goal."""
        return self.setpoint == self.goal

    def stands(self) -> bool:
        """Whether no joint moves, and none is told to."""
        speeds = self._data.qvel[self._dofs].tolist()
        return self.commanded() and all(abs(speed) < STANDS_1_S for speed in speeds)

    def arrived(self) -> bool:
        """Whether goal, commands and joints agree (within 6 mm or 0.02 rad)."""
        return self.commanded() and all(
            abs(float(self._data.qpos[at]) - goal) < 0.02
            for at, goal in zip(self._qpos, self.goal, strict=True)
        )

    def stowed(self) -> bool:
        """Whether setpoints and goal are the folded pose."""
        return self.goal == self.setpoint == self._stow

    def tick(self, ctrl: list[float]) -> None:
        """Write the commands for the next control period."""
        if self.setpoint != self.goal:
            self._approach_goal()
        for motor, value in zip(self._ctrl, self.setpoint, strict=True):
            ctrl[motor] = value

    def _approach_goal(self) -> None:
        steps = max(
            self.slowness * abs(goal - now) / (speed * PERIOD_S)
            for goal, now, speed in zip(self.goal, self.setpoint, self.entry.speeds, strict=True)
        )
        share = 1.0 if steps <= 1.0 else 1.0 / steps
        self.setpoint = [
            goal if share == 1.0 else now + (goal - now) * share
            for goal, now in zip(self.goal, self.setpoint, strict=True)
        ]

    def solve(
        self,
        point_m: tuple[float, float, float],
        seed: Sequence[float],
        opening_rad: float | None = None,
    ) -> list[float] | None:
        """Joint values that bring the grip site to `point_m` with the hand pointing down.

        Damped least squares over position (m) and the hand's axis (rad) from where the base is now,
        or is `imagined`.
        `opening_rad` is the heading along which the fingers shall open (either way round).
        `None`: out of reach from this seed. Leaves the arm as it is.
        """
        import mujoco
        import numpy as np

        scratch, model = self._as_imagined(), self._model
        values = np.array(seed, dtype=float)
        low, high = np.array(self._limits).T
        jacobian_p = np.zeros((3, model.nv))
        jacobian_r = np.zeros((3, model.nv))
        down = np.array([0.0, 0.0, -1.0])
        target = np.array(point_m)
        for _ in range(ITERATIONS):
            scratch.qpos[self._qpos] = values
            mujoco.mj_kinematics(model, scratch)
            mujoco.mj_comPos(model, scratch)
            frame = scratch.site_xmat[self._site].reshape(3, 3)
            off = target - scratch.site_xpos[self._site]
            turn = np.cross(frame[:, 0], down)
            if opening_rad is not None:
                wanted = np.array([math.cos(opening_rad), math.sin(opening_rad), 0.0])
                if frame[:, 1] @ wanted < 0.0:
                    wanted = -wanted
                turn = turn + np.array([0.0, 0.0, np.cross(frame[:, 1], wanted)[2]])
            if np.linalg.norm(off) < POINT_TOLERANCE_M and np.linalg.norm(turn) < 0.5 * (
                AXIS_TOLERANCE_RAD
            ):
                return [float(value) for value in values]
            mujoco.mj_jacSite(model, scratch, jacobian_p, jacobian_r, self._site)
            rows = np.vstack([jacobian_p[:, self._dofs], jacobian_r[:, self._dofs]])
            if opening_rad is None:
                # the turn about the vertical is free
                rows[5] = 0.0
            error = np.concatenate([off, turn])
            step = rows.T @ np.linalg.solve(rows @ rows.T + DAMPING * np.eye(6), error)
            values = np.clip(values + np.clip(step, -0.3, 0.3), low, high)
        return None

    def _as_imagined(self) -> Any:
        self._scratch.qpos[:] = self._data.qpos
        if self.imagined is not None:
            self.imagined(self._scratch)
        return self._scratch

    def obstacle(self, values: Sequence[float], gap_m: float = 0.0) -> str | None:
        """What the robot would touch with these joint values (not objects), or come nearer to than
        `gap_m`; or `None`.

        Furniture, its doors and drawers by their names, another robot by its own.
        """
        import mujoco

        scratch, model = self._as_imagined(), self._model
        scratch.qpos[self._qpos] = values
        model.geom_margin[self._links] = gap_m
        mujoco.mj_fwdPosition(model, scratch)
        model.geom_margin[self._links] = 0.0
        for contact in scratch.contact[: scratch.ncon]:
            bodies = [int(model.geom_bodyid[geom]) for geom in contact.geom]
            roots = [int(model.body_rootid[body]) for body in bodies]
            if self._robot_root not in roots or contact.dist > gap_m - 0.001:
                continue
            other = str(model.body(bodies[1 - roots.index(self._robot_root)]).name)
            kind, _, name = other.partition("/")
            if kind != "object" and other != "floor":
                return name.rpartition("/")[2] if kind == "furniture" else kind
        return None

    def obstacle_between(
        self, start: Sequence[float], end: Sequence[float], gap_m: float = 0.0
    ) -> str | None:
        """As `obstacle`, on the way from `start` up to `end`, which is straight in joint values.

        Where the elbow goes over to its other bend, the hand swings far out.
        """
        for step in range(WAY_STEPS):
            share = step / WAY_STEPS
            if (hit := self.obstacle(_between(start, end, share), gap_m)) is not None:
                return hit
        return None

    def strays_m(self, start: Sequence[float], end: Sequence[float]) -> float:
        """How far the hand gets aside, on the floor plan, halfway from `start` to `end` [m]."""
        import mujoco

        at = []
        for share in (0.5, 1.0):
            scratch = self._as_imagined()
            scratch.qpos[self._qpos] = _between(start, end, share)
            mujoco.mj_kinematics(self._model, scratch)
            at.append([float(v) for v in scratch.site_xpos[self._site][:2]])
        return math.dist(*at)


def _between(start: Sequence[float], end: Sequence[float], share: float) -> list[float]:
    """Joint values that share of the way from one set of them to another."""
    return [a + share * (b - a) for a, b in zip(start, end, strict=True)]


class Gripper:
    """Two fingers driven as one. Widths are from the middle to each finger, m."""

    def __init__(self, model: Any, data: Any, prefix: str, entry: GripperEntry) -> None:
        self.entry = entry
        self._data = data
        self._ctrl = int(model.actuator(prefix + entry.actuator).id)
        joint = model.joint(prefix + entry.joint)
        self._qpos = int(joint.qposadr[0])
        self._fingers = [self._qpos, *_driven_along(model, int(joint.id))]
        self._touch = [int(model.sensor(prefix + name).adr[0]) for name in entry.touch]
        self._setpoint = 0.0
        self._goal = 0.0

    def opening_m(self) -> float:
        """How far each finger is from the middle."""
        return float(self._data.qpos[self._qpos])

    def write_opening(self, data: Any, opening_m: float) -> None:
        """Put the fingers so far from the middle in `data`, which need not be the world's own."""
        data.qpos[self._fingers] = opening_m

    def open(self, to_m: float | None = None) -> None:
        """Let go."""
        self._goal = self.entry.open_m if to_m is None else min(to_m, self.entry.open_m)
        self._setpoint = max(self._setpoint, min(self.opening_m(), self._goal))

    def close(self) -> None:
        """Close and press."""
        self._goal = self.entry.squeeze_m

    def keep(self) -> None:
        """Open no farther, and keep what is still between the fingers."""
        if self._goal > self._setpoint:
            if self.feels():
                self.close()
            else:
                self._goal = self._setpoint

    def commanded(self) -> bool:
        """Whether the command has come to where the fingers shall be."""
        return self._setpoint == self._goal

    def feels(self) -> bool:
        """Whether both fingers press on something that keeps them apart."""
        touched = all(float(self._data.sensordata[at]) > TOUCH_N for at in self._touch)
        return touched and self.opening_m() > CLOSED_M

    def tick(self, ctrl: list[float]) -> None:
        """Write the command for the next control period."""
        most = FINGER_SPEED_M_S * PERIOD_S
        change = max(-most, min(most, self._goal - self._setpoint))
        self._setpoint = self._goal if abs(change) < most else self._setpoint + change
        ctrl[self._ctrl] = self._setpoint


def _driven_along(model: Any, joint: int) -> list[int]:
    """Where in `qpos` the joints are that an equality ties to another one."""
    import mujoco

    ties = model.eq_type == mujoco.mjtEq.mjEQ_JOINT
    tied = [int(model.eq_obj1id[k]) for k in (ties & (model.eq_obj2id == joint)).nonzero()[0]]
    return [int(model.jnt_qposadr[other]) for other in tied]
