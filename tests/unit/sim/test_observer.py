"""What is looked at to see and to know what lies in baskets: no more than it takes."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any

import msgspec
import mujoco
import pytest

from keyexpr_schema.payloads.robots import PoseMRad, RobotSpec
from sim.files.robot_file import load_robot
from sim.files.world_file import load_world
from sim.mujoco_world.assemble import compile_world
from sim.mujoco_world.description import load_description
from sim.mujoco_world.mechanisms import Mechanisms
from sim.mujoco_world.observer import POINTS, VISIBLE, Observer
from sim.mujoco_world.robot_body import RobotBody
from sim.states import ThingStates

HOME = load_world("home")
HSR, LOCOBOT = load_robot("hsr"), load_robot("locobot")


class Counted:
    """`mujoco.MjData` that counts what is read of it."""

    def __init__(self, data: Any) -> None:
        self.data, self.reads = data, Counter[str]()

    def __getattr__(self, name: str) -> Any:
        self.reads[name] += 1
        return getattr(self.data, name)


def observed(
    robots: dict[str, tuple[RobotSpec, PoseMRad]],
) -> tuple[Observer, dict[str, RobotBody], Counted]:
    found = {name: load_description(spec.model) for name, (spec, _) in robots.items()}
    model = compile_world(HOME, list(found.items()))
    data = mujoco.MjData(model)
    bodies = {
        name: RobotBody(model, data, msgspec.structs.replace(spec, robot=name), found[name], start)
        for name, (spec, start) in robots.items()
    }
    counted = Counted(data)
    mechanisms = Mechanisms(model, data, HOME, bodies, ThingStates(HOME))
    return Observer(model, counted, HOME, bodies, {}, mechanisms, 0), bodies, counted


@pytest.mark.parametrize(
    ("pose", "visible", "rays"),
    [
        ((1.5, 3.4, 2.1), True, VISIBLE),
        # from the other side of a wall
        ((4.6, 4.8, math.pi), False, len(POINTS) - VISIBLE + 1),
    ],
)
def test_rays_go_out_until_it_is_clear_whether_a_thing_is_seen(
    monkeypatch: pytest.MonkeyPatch, pose: PoseMRad, visible: bool, rays: int
) -> None:
    observer, bodies, data = observed({"hsr": (HSR, pose)})
    mujoco.mj_forward(data.model, data.data)
    ray, sent = mujoco.mj_ray, []

    def counted(*args: Any) -> Any:
        sent.append(args)
        return ray(args[0], data.data, *args[2:])

    monkeypatch.setattr(mujoco, "mj_ray", counted)
    assert "cup_2" in observer.in_view(bodies["hsr"])
    assert observer.sees(bodies["hsr"], "cup_2") is visible
    assert len(sent) == rays


def test_all_baskets_are_looked_into_once_for_a_moment() -> None:
    starts = [(2.0, 3.0, 0.4), (2.8, 3.0, -0.4), (7.0, 3.0, 1.0)]
    fleet = {f"c{number}": (LOCOBOT, start) for number, start in enumerate(starts)}
    observer, bodies, data = observed(fleet)
    for cup, (x, y, _) in (("cup_1", starts[1]), ("cup_2", starts[2])):
        data.data.joint(f"object/{cup}").qpos[:3] = (x, y, 0.341)
    mujoco.mj_forward(data.model, data.data)
    data.reads.clear()
    assert [observer.basket(bodies[name]) for name in fleet] == [(), ("cup_1",), ("cup_2",)]
    assert {truth.object: truth.place for truth in observer.truths(0.0)} == {
        "cup_1": "kitchen",
        "cup_2": "living_room",
    }
    assert data.reads["site_xmat"] == 1
    data.data.joint("object/cup_1").qpos[0] += 0.2
    mujoco.mj_step(data.model, data.data)
    assert [observer.basket(bodies[name]) for name in fleet] == [(), (), ("cup_2",)]
    assert data.reads["site_xmat"] == 2
