"""What the controllers must know of a robot model: the YAML file beside its MJCF, as types.

A model NAME is two files in one folder, NAME.xml (MJCF) and NAME.model.yaml (this).
Metres, radians; joint, actuator, site, geom and body names are those of the MJCF.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import msgspec

from keyexpr_schema.config_files import config_folders
from keyexpr_schema.yaml_reader import YamlFile
from sim.errors import BadFile
from sim.files.yaml_file import FileEntry, read_entries

MODELS = Path(__file__).resolve().parent.parent / "models"
"""The models that come with this package."""

Positive = Annotated[float, msgspec.Meta(gt=0.0)]


class PlanarDrive(FileEntry, frozen=True, tag_field="kind", tag="planar"):
    """Moves in any direction: three joints (x, y, yaw in the world frame) with velocity servos."""

    joints: tuple[str, str, str]
    actuators: tuple[str, str, str]
    acceleration_m_s2: Positive = 0.8
    yaw_rate_rad_s: Positive = 1.2


class DifferentialDrive(FileEntry, frozen=True, tag_field="kind", tag="differential"):
    """Two driven wheels under a free body. Joints: the free one, left wheel, right wheel."""

    joints: tuple[str, str, str]
    actuators: tuple[str, str]
    wheel_radius_m: Positive
    wheel_separation_m: Positive
    acceleration_m_s2: Positive = 0.6
    yaw_rate_rad_s: Positive = 1.2


class FixedBase(FileEntry, frozen=True, tag_field="kind", tag="fixed"):
    """Stands where it is put, and turns about the vertical: one joint with a velocity servo."""

    joint: str
    actuator: str
    yaw_rate_rad_s: Positive = 1.2


class CameraEntry(FileEntry, frozen=True):
    """A camera at `site`, looking along the base's x axis."""

    site: str
    fov_deg: Positive = 70.0


class ArmEntry(FileEntry, frozen=True):
    """An arm that reaches down: the hand's x axis (of `grip_site`) points at the floor.

    `stow` and `seeds` are joint values in the order of `joints`; `speeds` in m/s or rad/s.
    `reach_m` is the horizontal distance from the base's axis, (least, greatest).
    """

    joints: tuple[str, ...]
    actuators: tuple[str, ...]
    speeds: tuple[Positive, ...]
    grip_site: str
    stow: tuple[float, ...]
    seeds: Annotated[tuple[tuple[float, ...], ...], msgspec.Meta(min_length=1)]
    reach_m: tuple[Positive, Positive]


class GripperEntry(FileEntry, frozen=True):
    """Two fingers that move as one; a position servo whose zero is closed.

    `touch` are touch sensors (N) on the finger pads, `pads` the geoms that hold.
    """

    actuator: str
    joint: str
    touch: tuple[str, str]
    pads: tuple[str, str]
    open_m: Positive
    squeeze_m: float
    finger_depth_m: Positive


class BasketEntry(FileEntry, frozen=True):
    """`site` is a box: the volume in which the base of a carried object lies."""

    site: str
    body: str


class Description(FileEntry, frozen=True):
    """A robot model, for its controllers."""

    base: PlanarDrive | DifferentialDrive | FixedBase
    radius_m: Positive
    clearance_m: Positive
    camera: CameraEntry | None = None
    arm: ArmEntry | None = None
    gripper: GripperEntry | None = None
    basket: BasketEntry | None = None
    hand_bodies: tuple[str, ...] = ()


@dataclass(frozen=True)
class RobotModel:
    """A model's MJCF file and its description."""

    name: str
    mjcf: Path
    description: Description


def load_description(name: str, beside: Path | None = None) -> RobotModel:
    """The model called `name`: from the folder `beside` that a robot's file is in, else from the
    folders of robot files, else from `MODELS`.

    Raises:
        BadFile: there is none, or its description says what cannot be.
    """
    places = (*(() if beside is None else (beside,)), *config_folders("robots"), MODELS)
    for folder in places:
        mjcf, described = folder / f"{name}.xml", folder / f"{name}.model.yaml"
        if not mjcf.is_file():
            continue
        if not described.is_file():
            raise BadFile(
                f"{mjcf} has no description: write {described} (see {MODELS / 'hsr.model.yaml'})"
            )
        found, file = read_entries(described, Description, "model description")
        _check(file, found)
        return RobotModel(name=name, mjcf=mjcf, description=found)
    known = sorted({file.stem for folder in places for file in folder.glob("*.xml")})
    raise BadFile(
        f"there is no robot model {name!r} (looked for {name}.xml in "
        f"{', '.join(map(str, places))}); there are {', '.join(known)}"
    )


def _check(file: YamlFile, found: Description) -> None:
    arm = found.arm
    if (arm is None) != (found.gripper is None):
        raise BadFile(
            f"{file.at('arm')}: an arm needs a gripper and a gripper an arm; give both or neither"
        )
    if arm is None:
        return
    count = len(arm.joints)
    for field, values in (
        ("actuators", arm.actuators),
        ("speeds", arm.speeds),
        ("stow", arm.stow),
        *((f"seeds[{number}]", seed) for number, seed in enumerate(arm.seeds)),
    ):
        if len(values) != count:
            raise BadFile(
                f"{file.at(f'arm.{field}')} has {len(values)} values; arm.joints has {count}, "
                "and each needs one"
            )
    if arm.reach_m[0] >= arm.reach_m[1]:
        raise BadFile(f"{file.at('arm.reach_m')} is (least, greatest), and the first is not less")
