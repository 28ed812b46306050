"""One robot in the physical world: its base, arm, hand, basket and what it feels."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from keyexpr_schema.payloads.motions import PointM
from keyexpr_schema.payloads.robots import PoseMRad, RobotSpec
from sim.errors import BadFile
from sim.files.furniture_schema import PointXY
from sim.files.solids import Solid
from sim.mujoco_world.arm import Arm, Gripper
from sim.mujoco_world.base_controllers import PERIOD_S
from sim.mujoco_world.description import FixedBase, RobotModel
from sim.mujoco_world.turning_bases import Turret, make_drive
from sim.navigation.spots import STANDS_OFF_M

LOST_AFTER_S = 0.3
"""A hand that feels nothing for this long is empty: a pad can lose touch for a moment on a jolt."""


class RobotBody:
    """Handles on one robot's joints, motors and sensors.

    Raises:
        BadFile: the description names a part that the MJCF lacks.
    """

    def __init__(
        self, model: Any, data: Any, spec: RobotSpec, found: RobotModel, start: PoseMRad
    ) -> None:
        self.name = spec.robot
        self.spec = spec
        self.description = found.description
        prefix = f"{spec.robot}/"
        self._data = data
        self.held: str | None = None
        """What is in the hand, as far as the robot knows."""
        self.reaching_for: str | None = None
        """What the hand was last commanded to grasp: a hand feels that it holds, not what."""
        self.grip_above_base_m = 0.0
        """How far above the held object's base the hand took it."""
        self.way_out: PoseMRad | None = None
        """Where to drive before the arm is folded, when it reaches in under a roof."""
        self.in_vain: list[tuple[PointM, PointXY]] = []
        """Points that the hand did not get to, each with where the robot stood."""
        self._untouched_s = 0.0
        about = found.description
        if isinstance(about.base, FixedBase) == ("drive" in spec.capabilities):
            has = "has" if "drive" in spec.capabilities else "has no"
            does = "does not drive" if "drive" in spec.capabilities else "drives"
            raise BadFile(
                f"robot {spec.robot} {has} capability `drive`, and its model {found.name} {does}: "
                "name another model, or change the capabilities in the robot file"
            )
        try:
            self.drive = make_drive(model, data, prefix, about, spec.capabilities.get("drive", 0.3))
            self.arm = Arm(model, data, prefix, about.arm) if about.arm else None
            self.gripper = Gripper(model, data, prefix, about.gripper) if about.gripper else None
            self.camera = int(model.site(prefix + about.camera.site).id) if about.camera else -1
            self.basket = int(model.site(prefix + about.basket.site).id) if about.basket else -1
            self.basket_body = (
                int(model.body(prefix + about.basket.body).id) if about.basket else -1
            )
            self.pads = tuple(
                int(model.geom(prefix + name).id)
                for name in (about.gripper.pads if about.gripper else ())
            )
            self.hand_bodies = frozenset(
                int(model.body(prefix + name).id) for name in about.hand_bodies
            )
        except KeyError as error:
            part = str(error.args[0]).replace(prefix, "")
            beside = found.mjcf.with_suffix(".model.yaml")
            raise BadFile(f"{beside} names what {found.mjcf.name} lacks: {part}") from None
        self.basket_half_m = tuple(
            float(v) for v in (model.site_size[self.basket] if self.basket >= 0 else (0, 0, 0))
        )
        self.drive.put(start)
        if self.arm is not None:
            self.arm.put_stowed()

    @property
    def drives(self) -> bool:
        """Whether it can go anywhere, and does not stand where it was put."""
        return not isinstance(self.drive, Turret)

    def pose(self) -> PoseMRad:
        """(x, y, yaw), world frame."""
        return self.drive.pose()

    @contextmanager
    def imagined(
        self, pose_m_rad: PoseMRad | None = None, opening_m: float | None = None
    ) -> Iterator[None]:
        """Meanwhile its arm reckons as if it stood there, its fingers so far from their middle."""
        arm, gripper = self.arm, self.gripper
        assert arm is not None
        before = arm.imagined

        def put(data: Any) -> None:
            if before is not None:
                before(data)
            if pose_m_rad is not None:
                self.drive.write_pose(data, pose_m_rad)
            if opening_m is not None and gripper is not None:
                gripper.write_opening(data, opening_m)

        arm.imagined = put
        try:
            yield
        finally:
            arm.imagined = before

    def solid(self) -> Solid:
        """The floor that it takes up, as an upright box, less what others keep away anyway."""
        x, y, _ = self.pose()
        half = self.description.clearance_m - STANDS_OFF_M
        return Solid("robot", self.name, (x, y), (half, half), 0.0, 1.0)

    def moving(self) -> bool:
        """Whether the base is on the move."""
        speed, rate = self.drive.speed()
        return speed > 0.02 or rate > 0.05

    def stands(self) -> bool:
        """Whether neither base nor arm nor fingers move, and none of them is told to."""
        still = self.drive.stands() and (self.arm is None or self.arm.stands())
        return still and (self.gripper is None or self.gripper.commanded())

    def arm_out(self) -> bool:
        """Whether the arm reaches past the base, so that driving could knock something over."""
        return self.arm is not None and not self.arm.stowed()

    def freeze(self) -> None:
        """Halt base and arm; the hand goes on."""
        self.drive.brake()
        if self.arm is not None:
            self.arm.freeze()

    def keep(self) -> None:
        """A hand that opens stays as it is, and keeps what it still has."""
        if self.gripper is not None:
            self.gripper.keep()

    def tick(self, ctrl: list[float]) -> None:
        """Read the hand's sensors, write all commands for the next control period."""
        self.drive.carrying = self.held is not None
        self.drive.tick(ctrl)
        if self.arm is not None:
            self.arm.tick(ctrl)
        if self.gripper is not None:
            self.gripper.tick(ctrl)
            feels = self.gripper.feels()
            self._untouched_s = 0.0 if feels else self._untouched_s + PERIOD_S
            if feels and self.held is None:
                self.held = self.reaching_for
            elif self.held is not None and self._untouched_s > LOST_AFTER_S:
                self.let_go()

    def let_go(self) -> None:
        """The hand is empty from now on."""
        self.held = self.reaching_for = None

    def basket_point(self, x_m: float, y_m: float) -> tuple[float, float, float]:
        """A point of the basket's floor, given from its centre, in the world frame."""
        frame = self._data.site_xmat[self.basket].reshape(3, 3)
        x, y, z = (
            float(v)
            for v in self._data.site_xpos[self.basket] + frame @ (x_m, y_m, -self.basket_half_m[2])
        )
        return (x, y, z)
