"""Loads robot files and checks that what they say can be: without what a world's file takes."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import msgspec

from keyexpr_schema.errors import InvalidId
from keyexpr_schema.ids import check_name
from keyexpr_schema.payloads.robots import RobotSpec
from sim.errors import BadFile
from sim.files.deployment_schema import DeploymentEntry
from sim.files.yaml_file import find_file, read_entries


class _Most(NamedTuple):
    value: float
    unit: str


MOST = {
    "drive": _Most(10.0, "m/s; is this in cm/s?"),
    "see": _Most(100.0, "metres; is this in centimetres?"),
    "grip": _Most(500.0, "kilograms; is this in grams?"),
    "reach": _Most(10.0, "metres; is this in centimetres?"),
}
"""What robots can do at most, of the capabilities whose unit the shipped skills fix."""


class _RobotFile(RobotSpec, frozen=True, kw_only=True):
    deployment: DeploymentEntry | None = None


def load_robot(file: str | Path) -> RobotSpec:
    """The robot file given by path or name (see `config_file`), checked."""
    return load_deployment(file)[0]


def load_deployment(file: str | Path) -> tuple[RobotSpec, DeploymentEntry]:
    """A robot file as `load_robot`, and how its worker is deployed."""
    entry, written = read_entries(find_file("robots", file), _RobotFile, "robot file")
    spec = msgspec.convert(entry, RobotSpec, from_attributes=True)
    deployment = entry.deployment or DeploymentEntry()
    for field, sentence in deployment.faults():
        raise BadFile(f"{written.at(f'deployment.{field}')}: {sentence}")
    check_robot_name(written.at("robot"), spec.robot)
    for name, value in spec.capabilities.items():
        where, most = written.at(f"capabilities.{name}"), MOST.get(name)
        if value < 0.0:
            raise BadFile(f"{where}: {value} is not a number from 0 up")
        if most is not None and value > most.value:
            raise BadFile(f"{where}: {value} is more than {most.value:g}, and that is {most.unit}")
    # A robot that does not drive has no such skill, either.
    if spec.capabilities.get("drive", 0.0) <= 0.0 and (
        "navigate" in spec.skills or "drive" in spec.capabilities
    ):
        raise BadFile(
            f"{written.at('capabilities')}: it lacks `drive`, the robot's top speed in m/s "
            "(such as 0.6)"
        )
    return spec, deployment


def check_robot_name(where: str, robot: str) -> None:
    """Do nothing if a robot can be called that.

    Raises:
        BadFile: it cannot; one sentence that begins with `where`.
    """
    try:
        check_name(robot, "robot")
    except InvalidId as error:
        raise BadFile(f"{where}: {error}") from None
