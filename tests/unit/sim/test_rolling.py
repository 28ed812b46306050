"""What is round rolls, and comes to rest: a judge waits for that."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim.files.world_file import load_world
from sim.mujoco_world.assemble import compile_world
from sim.mujoco_world.observer import SETTLED_M_S, SETTLED_RAD_S
from sim.server.sim_server import REST_S

HOME = Path(__file__).parents[3] / "configs" / "worlds" / "home.yaml"
ROUND = {
    "ball": "{shape: sphere, radius_m: 0.035, mass_kg: 0.1}",
    "can": "{shape: cylinder, radius_m: 0.035, height_m: 0.1, mass_kg: 0.3}",
}


@pytest.mark.parametrize("kind", ROUND)
def test_what_rolls_over_the_floor_comes_to_rest(kind: str, tmp_path: Path) -> None:
    import mujoco

    world = HOME.read_text(encoding="utf-8")
    world = world.replace("object_kinds:\n", f"object_kinds:\n  {kind}: {ROUND[kind]}\n")
    it = f"  it: {{kind: {kind}, on: floor, at_m: [4.0, 3.0]}}\n"
    path = tmp_path / "world.yaml"
    path.write_text(world.replace("\nobjects:\n", f"\nobjects:\n{it}"), encoding="utf-8")
    model = compile_world(load_world(path), [])
    data = mujoco.MjData(model)
    joint = model.joint("object/it")
    if kind == "can":  # it lies
        data.qpos[joint.qposadr[0] + 2 : joint.qposadr[0] + 7] = (0.04, 0.7071, 0.7071, 0.0, 0.0)
    speed = data.qvel[joint.dofadr[0] : joint.dofadr[0] + 6]
    speed[0] = 0.4
    moved = False
    while data.time < REST_S:
        mujoco.mj_step(model, data)
        fast = (abs(speed[:3]).max() >= SETTLED_M_S, abs(speed[3:]).max() >= SETTLED_RAD_S)
        moved = moved or all(fast)
        if moved and not any(fast):
            break
    assert moved  # it rolled
    assert data.time < REST_S
