"""Bases that drive in the physics keep to the lines they are led along."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from sim.files.robot_file import load_robot
from sim.mujoco_world import load_description
from sim.mujoco_world.assemble import STEP_S, compile_world
from sim.mujoco_world.base_controllers import PERIOD_S
from sim.mujoco_world.robot_body import RobotBody
from sim.navigation.lattice import PITCH_M, TRACKING_M
from sim.navigation.steering import passed, steer
from tests.support.furnished import furnished

START = (1.4, 1.6)
CORNER = (START[0] + 2 * PITCH_M, START[1])
LIMIT_S = 60.0


@pytest.mark.parametrize("robot", ["hsr", "butler", "locobot"])
@pytest.mark.parametrize("turn_deg", [45, 90, 135])
def test_a_robot_is_not_carried_past_a_corner_of_its_way(
    tmp_path: Path, robot: str, turn_deg: int
) -> None:
    import mujoco

    spec = load_robot(robot)
    found = load_description(spec.model)
    model = compile_world(furnished(tmp_path), [(spec.robot, found)])
    data = mujoco.MjData(model)
    body = RobotBody(model, data, spec, found, (*START, 0.0))
    mujoco.mj_forward(model, data)
    cos, sin = math.cos(math.radians(turn_deg)), math.sin(math.radians(turn_deg))
    end = (CORNER[0] + 2 * PITCH_M * cos, CORNER[1] + 2 * PITCH_M * sin)
    track = [START, CORNER, end]
    ctrl = data.ctrl.tolist()
    past_m = -math.inf
    while math.dist(body.pose()[:2], end) > TRACKING_M:
        assert data.time < LIMIT_S, f"it stays at {body.pose()}"
        while len(track) > 1 and passed(body.pose()[:2], track[:3]):
            del track[0]
        speed_m_s = spec.capabilities["drive"]
        leg = steer(
            body.pose(), track, on_line=True, yaw_rad=None, speed_m_s=speed_m_s, failed=None
        )
        body.drive.drive(*leg.target_m, leg.yaw_rad, leg.speed_limit_m_s)
        body.tick(ctrl)
        data.ctrl[:] = ctrl
        mujoco.mj_step(model, data, round(PERIOD_S / STEP_S))
        x, y, _ = body.pose()
        # on the outer side of the way that leads on from the corner
        past_m = max(past_m, (x - CORNER[0]) * sin - (y - CORNER[1]) * cos)
    assert past_m < TRACKING_M
