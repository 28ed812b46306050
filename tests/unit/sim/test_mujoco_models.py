"""The robot models: sizes, masses, folded arm, and clear words about a wrong description."""

from __future__ import annotations

import math
import shutil
from pathlib import Path

import msgspec
import pytest

from keyexpr_schema.payloads.robots import PoseMRad, RobotSpec
from sim.errors import BadFile
from sim.files.mission_file import load_mission
from sim.files.robot_file import load_robot
from sim.files.world_file import load_world
from sim.files.world_schema import WorldFile
from sim.mujoco_world import MODELS, MujocoBackend, load_description
from sim.mujoco_world.arm import Arm
from sim.mujoco_world.assemble import compile_world
from sim.mujoco_world.robot_body import RobotBody
from sim.server.process import make_backend
from tests.support.furnished import furnished

HOME = load_world("home")
HSR = load_robot("hsr")
LOCOBOT = load_robot("locobot")


def alone(spec: RobotSpec, folder: Path | None = None) -> MujocoBackend:
    folders = {spec.robot: folder} if folder else {}
    return MujocoBackend(HOME, [(spec, (2.5, 3.0, 0.0))], model_folders=folders)


def arm_of_hsr(world: WorldFile = HOME, pose: PoseMRad = (2.5, 3.0, 0.0)) -> tuple[Arm, PoseMRad]:
    """The arm of a robot that stands still at the pose."""
    import mujoco

    found = load_description(HSR.model)
    model = compile_world(world, [("hsr", found)])
    data = mujoco.MjData(model)
    body = RobotBody(model, data, HSR, found, pose)
    mujoco.mj_forward(model, data)
    assert body.arm is not None
    return body.arm, body.pose()


def reach_of_shapes(backend: MujocoBackend, robot: str) -> tuple[float, float]:
    """How far shapes reach from the base's axis (centre and radius of a sphere inside), and up."""
    frame = backend.frame().poses
    x0, y0, _ = backend.senses(robot).pose_m_rad
    far = top = 0.0
    for body in backend.scene().bodies:
        if body.owner != robot:
            continue
        (x, y, z), (w, i, j, k) = frame[body.body]
        for shape in body.shapes:
            px, py, pz = shape.point_m
            # rotate by the body's quaternion
            tx, ty, tz = 2 * (j * pz - k * py), 2 * (k * px - i * pz), 2 * (i * py - j * px)
            gx = x + px + w * tx + j * tz - k * ty
            gy = y + py + w * ty + k * tx - i * tz
            gz = z + pz + w * tz + i * ty - j * tx
            far = max(far, math.dist((gx, gy), (x0, y0)))
            top = max(top, gz)
    return far, top


@pytest.mark.parametrize(
    ("spec", "mass_kg", "height_m"),
    [(HSR, (35.0, 39.0), (1.0, 1.35)), (LOCOBOT, (6.0, 7.0), (0.4, 0.65))],
)
def test_models_have_the_mass_and_size_of_what_they_are_named_after(
    spec: RobotSpec, mass_kg: tuple[float, float], height_m: tuple[float, float]
) -> None:
    import mujoco

    found = load_description(spec.model)
    model = mujoco.MjModel.from_xml_path(str(found.mjcf))
    assert mass_kg[0] <= float(model.body("base").subtreemass[0]) <= mass_kg[1]
    far, top = reach_of_shapes(alone(spec), spec.robot)
    assert far <= found.description.clearance_m
    assert height_m[0] <= top + 0.02 <= height_m[1]


@pytest.mark.parametrize("height_m", [0.0, 0.345, 0.45, 0.60, 0.75])
@pytest.mark.parametrize("distance_m", [0.43, 0.50, 0.55])
def test_the_arm_reaches_floor_baskets_and_tables(height_m: float, distance_m: float) -> None:
    arm, (x, y, yaw) = arm_of_hsr()
    target = (x + distance_m * math.cos(yaw), y + distance_m * math.sin(yaw), height_m + 0.06)
    solved = [arm.solve(target, seed) for seed in arm.entry.seeds]
    assert any(values is not None for values in solved)


def test_the_arm_does_not_pretend_to_reach_what_it_cannot() -> None:
    arm, (x, y, _) = arm_of_hsr()
    for target in ((x + 0.9, y, 0.6), (x + 0.5, y + 0.3, 0.6), (x + 0.5, y, 1.6)):
        assert all(arm.solve(target, seed) is None for seed in arm.entry.seeds)


def test_an_arm_that_turns_its_elbow_over_touches_what_neither_end_does(tmp_path: Path) -> None:
    arm, _ = arm_of_hsr(furnished(tmp_path), (3.4, 3.98, math.pi / 2))
    low, high, turned = (
        [0.62, -0.86, -0.71, 0.0],
        [0.67, -0.86, -0.71, 0.0],
        [0.1, 0.86, -2.43, 0.0],
    )
    assert [arm.obstacle(values) for values in (low, high, turned)] == [None] * 3
    assert arm.obstacle_between(high, low) is None
    assert arm.obstacle_between(turned, low) == "dresser"


def test_an_unknown_model_is_named_with_those_that_exist() -> None:
    with pytest.raises(BadFile, match=r"no robot model 'forklift'.*hsr, locobot"):
        load_description("forklift")


def test_a_model_of_ones_own_is_found_first_and_needs_a_description(tmp_path: Path) -> None:
    shutil.copy(MODELS / "locobot.xml", tmp_path / "porter.xml")
    with pytest.raises(BadFile, match=r"porter.xml has no description: write .*porter.model.yaml"):
        load_description("porter", tmp_path)
    shutil.copy(MODELS / "locobot.model.yaml", tmp_path / "porter.model.yaml")
    assert load_description("porter", tmp_path).mjcf == tmp_path / "porter.xml"
    spec = RobotSpec(robot="p", model="porter", skills=("navigate",), capabilities={"drive": 0.4})
    assert alone(spec, tmp_path).senses("p").basket == ()


def test_a_model_beside_the_robot_files_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "configs" / "robots"
    folder.mkdir(parents=True)
    shutil.copy(MODELS / "hsr.xml", folder / "butler.xml")
    shutil.copy(MODELS / "hsr.model.yaml", folder / "butler.model.yaml")
    monkeypatch.chdir(tmp_path)
    assert load_description("butler").description == load_description("hsr").description


def test_a_mission_finds_a_model_beside_the_robot_file_wherever_that_is(tmp_path: Path) -> None:
    folder = tmp_path / "bots"
    folder.mkdir()
    shutil.copy(MODELS / "hsr.xml", folder / "butler.xml")
    shutil.copy(MODELS / "hsr.model.yaml", folder / "butler.model.yaml")
    spec = "robot: butler\nmodel: butler\nskills: [navigate]\ncapabilities: {drive: 0.4}\n"
    (folder / "butler.yaml").write_text(spec)
    (tmp_path / "mission.yaml").write_text(
        "mission: m\nworld: home\nrobots: [{spec: bots/butler.yaml, start: {at_m: [2.5, 3.0]}}]\n"
    )
    loaded = load_mission(tmp_path / "mission.yaml")
    assert make_backend(loaded, "mujoco").senses("butler").pose_m_rad == pytest.approx(
        (2.5, 3.0, 0.0), abs=0.01
    )


def test_a_part_that_the_mjcf_lacks_is_named(tmp_path: Path) -> None:
    shutil.copy(MODELS / "locobot.xml", tmp_path / "porter.xml")
    text = (
        (MODELS / "locobot.model.yaml")
        .read_text()
        .replace("basket: {site: basket", "basket: {site: tub")
    )
    (tmp_path / "porter.model.yaml").write_text(text)
    spec = RobotSpec(robot="p", model="porter", skills=("navigate",), capabilities={"drive": 0.4})
    with pytest.raises(BadFile, match=r"porter.model.yaml names what porter.xml lacks.*tub"):
        alone(spec, tmp_path)


def test_mjcf_that_mujoco_refuses_is_named(tmp_path: Path) -> None:
    (tmp_path / "porter.xml").write_text("<mujoco><worldbody><bodyy/></worldbody></mujoco>")
    shutil.copy(MODELS / "locobot.model.yaml", tmp_path / "porter.model.yaml")
    spec = RobotSpec(robot="p", model="porter", skills=("navigate",), capabilities={"drive": 0.4})
    with pytest.raises(BadFile, match=r"porter.xml: MuJoCo refuses this model: .*bodyy"):
        alone(spec, tmp_path)


def test_joint_values_must_be_as_many_as_joints(tmp_path: Path) -> None:
    shutil.copy(MODELS / "hsr.xml", tmp_path / "mine.xml")
    text = (
        (MODELS / "hsr.model.yaml")
        .read_text()
        .replace("speeds: [0.3, 1.2, 1.6, 1.6]", "speeds: [0.3]")
    )
    (tmp_path / "mine.model.yaml").write_text(text)
    with pytest.raises(BadFile, match=r"arm.speeds has 1 values; arm.joints has 4"):
        load_description("mine", tmp_path)


@pytest.mark.parametrize(
    ("robot", "model", "said"),
    [
        ("hsr", "bench_arm", r"robot hsr has capability `drive`, and its model bench_arm does not"),
        ("bench_arm", "hsr", r"bench_arm has no capability `drive`, and its model hsr drives"),
    ],
)
def test_a_robot_drives_as_its_model_does(robot: str, model: str, said: str) -> None:
    spec = msgspec.structs.replace(load_robot(robot), model=model)
    with pytest.raises(BadFile, match=said):
        MujocoBackend(load_world("workshop"), [(spec, (4.6, 2.4, 0.0))])
