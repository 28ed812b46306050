"""`MujocoBackend`: the shared world of `sim.backend` with physics."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import msgspec

from keyexpr_schema.payloads.closures import Closure
from keyexpr_schema.payloads.motions import (
    Detection,
    Motion,
    MotionKind,
    MotionOutcome,
    MotionState,
    Senses,
)
from keyexpr_schema.payloads.robots import PoseMRad, RobotSpec
from keyexpr_schema.payloads.simulation import ContactCount, Frame, Scene, Truth
from sim.backend import Backend
from sim.batteries import Use
from sim.files.world_schema import WorldFile
from sim.mujoco_world.approaching import approach
from sim.mujoco_world.assemble import STEP_S, compile_world
from sim.mujoco_world.base_controllers import PERIOD_S
from sim.mujoco_world.base_motions import fold, go_to, look
from sim.mujoco_world.charging import charge_at
from sim.mujoco_world.collisions import Collisions
from sim.mujoco_world.description import load_description
from sim.mujoco_world.drawing import FrameDrawer, draw_scene
from sim.mujoco_world.grasping import release
from sim.mujoco_world.handover import release_in_basket, take
from sim.mujoco_world.mechanisms import Mechanisms
from sim.mujoco_world.motion import MotionContext, MotionFailed, MotionRun, Steps
from sim.mujoco_world.observer import Observer
from sim.mujoco_world.opening import close_thing, open_thing
from sim.mujoco_world.placing import hand_over, place_at
from sim.mujoco_world.robot_body import RobotBody
from sim.mujoco_world.switching import switch
from sim.navigation import Navigator
from sim.states import ThingStates

STEPS = round(PERIOD_S / STEP_S)
WATCH_EVERY = 2
"""Contacts are looked at every so many physics steps (10 ms); a bump lasts longer."""

SETTLE_PERIODS = 6
"""Control periods before the clock starts, in which everything comes to rest where it stands."""

MOTIONS: dict[MotionKind, Callable[[MotionContext, MotionRun], Steps]] = {
    MotionKind.GO_TO: go_to,
    MotionKind.LOOK: look,
    MotionKind.APPROACH: approach,
    MotionKind.GRASP: take,
    MotionKind.RELEASE: release,
    MotionKind.RELEASE_IN_BASKET: release_in_basket,
    MotionKind.STOW: fold,
    MotionKind.PLACE_AT: place_at,
    MotionKind.HAND_OVER: hand_over,
    MotionKind.OPEN: open_thing,
    MotionKind.CLOSE: close_thing,
    MotionKind.SWITCH_ON: switch,
    MotionKind.SWITCH_OFF: switch,
    MotionKind.CHARGE: charge_at,
}


class MujocoBackend(Backend):
    """Robots, objects and a building in one MuJoCo model.

    The same commands at the same simulated times give the same run, to the last bit.

    Args:
        world: the building and its objects.
        robots: who is in it, each with its start (x [m], y [m], yaw [rad]).
        seed: for the noise of the cameras.
        model_folders: by robot, where to look for its model before the package's own.
        charge: by robot, how full its battery is at the start [%], where that is not full.

    Raises:
        BadFile: a robot's model is missing or wrong.
    """

    def __init__(
        self,
        world: WorldFile,
        robots: Sequence[tuple[RobotSpec, PoseMRad]],
        seed: int = 0,
        model_folders: Mapping[str, Path] = {},
        charge: Mapping[str, float] = {},
    ) -> None:
        import mujoco

        super().__init__(world, [spec for spec, _ in robots], charge)
        models = [load_description(spec.model, model_folders.get(spec.robot)) for spec, _ in robots]
        self._model = compile_world(
            world,
            [(spec.robot, found) for (spec, _), found in zip(robots, models, strict=True)],
            {spec.robot: start for spec, start in robots},
        )
        self._data = mujoco.MjData(self._model)
        self._bodies = {
            spec.robot: RobotBody(self._model, self._data, spec, found, start)
            for (spec, start), found in zip(robots, models, strict=True)
        }
        fixed = tuple(body.solid() for body in self._bodies.values() if not body.drives)
        navigator = Navigator(world, fixed)
        for (spec, start), found in zip(robots, models, strict=True):
            if self._bodies[spec.robot].drives:
                navigator.add_robot(
                    spec.robot,
                    start,
                    found.description.clearance_m,
                    spec.capabilities["drive"],
                    spec.model,
                )
        self._mechanisms = Mechanisms(
            self._model, self._data, world, self._bodies, ThingStates(world)
        )
        navigator.look_out_for(self._mechanisms.obstacles)
        observer = Observer(
            self._model, self._data, world, self._bodies, self.things, self._mechanisms, seed
        )
        self._context = MotionContext(
            world,
            self._bodies,
            navigator,
            observer,
            self._mechanisms,
            self.batteries,
            self._taken,
        )
        self._collisions = Collisions(self._model, self._data, self._bodies)
        self._runs: dict[str, MotionRun] = {}
        self._stood_still: frozenset[str] = frozenset()
        self._ctrl: list[float] = self._data.ctrl.tolist()
        self._scene = draw_scene(self._model, world.world, self.robots)
        self._frames = FrameDrawer(self._model, self._data, self._scene)
        mujoco.mj_forward(self._model, self._data)
        for _ in range(SETTLE_PERIODS):
            self._physics()
            self.time_s = round(self.time_s + PERIOD_S, 6)
        self.time_s = 0.0
        for body in self._bodies.values():
            body.drive.halt()

    def close(self, closures: Sequence[Closure]) -> None:
        self._context.navigator.close(closures)

    def truths(self) -> tuple[Truth, ...]:
        return self._context.observer.truths(self.time_s)

    def contacts(self) -> ContactCount:
        return ContactCount(
            time_s=self.time_s,
            robot_robot=self._collisions.robot_robot,
            robot_wall=self._collisions.robot_wall,
        )

    def scene(self) -> Scene:
        return self._scene

    def frame(self) -> Frame:
        return self._frames.draw(self.time_s)

    def _begin(self, robot: str, motion: Motion) -> None:
        run = self._runs[robot] = MotionRun(self._bodies[robot], motion, self.time_s)
        run.steps = MOTIONS[motion.kind](self._context, run)

    def _stop(self, robot: str) -> None:
        run = self._runs.get(robot)
        if run is not None and run.ended is None:
            self._end(robot, run, MotionState.STOPPED, f"stopped while {run.phase}")

    def advance(self) -> None:
        context = self._context
        still = self._still()
        for robot in still - self._stood_still:
            self._bodies[robot].freeze()
        self._stood_still = still
        # A robot whose arm is out, stopped in mid-work perhaps, must not be moved.
        pinned = {*still, *(name for name, body in self._bodies.items() if body.arm_out())}
        for robot, run in self._runs.items():
            if run.ended is None:
                if run.manual or run.handling:
                    pinned.add(robot)
                if run.guest_of is not None:
                    pinned.add(run.guest_of)
        poses = {name: body.pose() for name, body in self._bodies.items() if body.drives}
        for robot in poses:
            context.navigator.pin(robot, robot in pinned)
        context.legs = context.navigator.tick(self.time_s, poses)
        for robot, run in self._runs.items():
            if run.ended is None:
                self._resume(robot, run)
        for robot, body in self._bodies.items():
            self._steer(robot, body)
        self._physics()
        self._pass_until(round(self.time_s + PERIOD_S, 6))
        self._mechanisms.advance(self.time_s, context.observer.contents)

    def _resume(self, robot: str, run: MotionRun) -> None:
        try:
            next(run.steps)
        except StopIteration as stop:
            self._end(robot, run, MotionState.SUCCEEDED, None, stop.value)
            return
        except MotionFailed as error:
            ajar = self._mechanisms.is_ajar(error.blocked_by)
            blocker = error.blocked_by if ajar else None
            self._end(robot, run, MotionState.FAILED, str(error))
            assert run.ended is not None
            run.ended = msgspec.structs.replace(
                run.ended, blocked_by=blocker, retryable=error.retryable
            )
            return
        if self.time_s - run.began_s >= run.motion.timeout_s:
            reason = (
                f"{run.motion.kind.value} took longer than {run.motion.timeout_s:g} s; "
                f"it was {run.phase}"
            )
            self._end(robot, run, MotionState.FAILED, reason)

    def _end(
        self,
        robot: str,
        run: MotionRun,
        state: MotionState,
        reason: str | None,
        detections: tuple[Detection, ...] = (),
    ) -> None:
        run.steps.close()
        if run.robot.drives:
            self._context.navigator.cancel(robot)
        self._note_stance(run, state)
        self._bodies[robot].freeze()
        if state is MotionState.STOPPED:
            self._bodies[robot].keep()
        if state is MotionState.FAILED:
            self._halt(robot)  # it may have been on its way
        run.ended = MotionOutcome(
            state=state,
            senses=self._senses(robot),
            reason=reason,
            detections=detections,
        )

    def _note_stance(self, run: MotionRun, state: MotionState) -> None:
        """Remember from where a hand did not get to a point, until one has got to one."""
        robot, point = run.robot, run.motion.point_m
        if run.motion.kind in (MotionKind.GRASP, MotionKind.RELEASE) and point is not None:
            if state is MotionState.SUCCEEDED:
                robot.in_vain.clear()
            elif state is MotionState.FAILED:
                robot.in_vain.append((point, robot.pose()[:2]))

    def _steer(self, robot: str, body: RobotBody) -> None:
        """Follow the navigator, unless the arm is out or the motion drives the base itself."""
        if body.arm_out():
            return
        run = self._runs.get(robot)
        if run is not None and run.ended is None and run.manual:
            return
        leg = self._context.legs.get(robot)
        if leg is not None:
            body.drive.drive(*leg.target_m, leg.yaw_rad, leg.speed_limit_m_s)

    def _physics(self) -> None:
        import mujoco
        import numpy as np

        old = np.array(self._ctrl)
        for body in self._bodies.values():
            body.tick(self._ctrl)
        change = (self._ctrl - old) / STEPS
        runs = {name: run for name, run in self._runs.items() if run.ended is None}
        for step in range(1, STEPS + 1):
            # A setpoint that moves smoothly does not shake what the hand holds.
            self._data.ctrl[:] = old + change * step
            mujoco.mj_step(self._model, self._data)
            self._context.observer.note_sleepers()
            if step % WATCH_EVERY == 0:
                self._collisions.watch(self.time_s, runs)
                self._mechanisms.watch(self.time_s)

    def _use(self, robot: str) -> Use:
        run = self._runs.get(robot)
        if run is None or run.ended is not None:
            return Use.IDLE
        if run.docked_at is not None:
            return Use.CHARGING
        return Use.DRIVING if self._bodies[robot].moving() else Use.WORKING

    def _charges_at(self, robot: str) -> str | None:
        run = self._runs.get(robot)
        return None if run is None or run.ended is not None else run.docked_at

    def _stands(self, robot: str) -> bool:
        return self._bodies[robot].stands()

    def _runs_still(self, robot: str) -> bool:
        run = self._runs.get(robot)
        return run is not None and run.ended is None

    def _outcome(self, robot: str) -> MotionOutcome | None:
        run = self._runs.get(robot)
        if run is None:
            return None
        if run.ended is not None:
            return run.ended
        return MotionOutcome(state=MotionState.RUNNING, senses=self._senses(robot))

    def _senses(self, robot: str) -> Senses:
        body = self._bodies[robot]
        x, y, yaw = body.pose()
        return Senses(
            robot=robot,
            time_s=self.time_s,
            pose_m_rad=(x, y, yaw),
            place=self.world.place_at(x, y),
            holding=body.held,
            basket=self._context.observer.basket(body),
            basket_sensor=True,
            moving=body.moving(),
            charge=self.batteries.charge(robot),
        )
