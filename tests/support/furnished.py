"""A small flat with something of everything, in which hands open, switch, put and give."""

from __future__ import annotations

from pathlib import Path

import msgspec

from keyexpr_schema.payloads.robots import PoseMRad, RobotSpec
from sim.files.robot_file import load_robot
from sim.files.world_file import load_world
from sim.files.world_schema import WorldFile

YAML = """
world: flat
size_m: [8.0, 5.0]
places:
  kitchen: {label: Kitchen, region_m: [[0.0, 0.0, 5.0, 5.0]]}
  hall: {label: Hall, region_m: [[5.0, 0.0, 8.0, 5.0]]}
furniture:
  table: {kind: table, place: kitchen, center_m: [1.0, 0.5], size_m: [1.2, 0.7, 0.6]}
  cupboard: {kind: cupboard, place: kitchen, center_m: [1.2, 4.75], size_m: [0.6, 0.5, 0.82]}
  dresser: {kind: drawers, place: kitchen, center_m: [3.4, 4.75], size_m: [0.6, 0.44, 0.62]}
  bookcase: {kind: shelf, place: hall, center_m: [6.5, 4.8], size_m: [0.9, 0.36, 0.8], boards: 2}
  oven:
    kind: counter
    called: oven
    place: kitchen
    center_m: [3.6, 0.35]
    size_m: [0.6, 0.6, 0.7]
    yaw_deg: 180
    switch: true
    process: {state: temperature, value: hot, after_s: 20}
  lamp: {kind: lamp, place: hall, center_m: [5.6, 0.5], size_m: [0.3, 0.3, 1.5], yaw_deg: 180}
people:
  anna: {at_m: [7.2, 0.7], yaw_deg: 90, label: Anna}
object_kinds:
  cup: {shape: cylinder, radius_m: 0.035, height_m: 0.10, mass_kg: 0.15}
  mug: {shape: cylinder, radius_m: 0.035, height_m: 0.09, mass_kg: 0.2, is: [cup]}
  bowl: {shape: bowl, radius_m: 0.052, height_m: 0.06, mass_kg: 0.2}
  spoon: {shape: box, size_m: [0.03, 0.03, 0.11], mass_kg: 0.05}
objects:
  cup_1: {kind: cup, in: cupboard, at_m: [0.0, -0.08]}
  mug_1: {kind: mug, on: table, at_m: [-0.3, 0.15]}
  bowl_1: {kind: bowl, on: table, at_m: [0.3, 0.15]}
  spoon_1: {kind: spoon, in: dresser_drawer_1, at_m: [0.1, -0.08]}
"""


def furnished(folder: Path, change: str = "") -> WorldFile:
    """The flat; `change` is more YAML at its end."""
    path = folder / "flat.yaml"
    path.write_text(YAML + change)
    return load_world(path)


def hsr(at: PoseMRad = (2.3, 2.5, 0.0), name: str = "hsr") -> tuple[RobotSpec, PoseMRad]:
    """An HSR that stands there."""
    return msgspec.structs.replace(load_robot("hsr"), robot=name), at
