"""A robot with the arm of `hsr` on two driven wheels."""

from __future__ import annotations

from pathlib import Path

import msgspec

from keyexpr_schema.payloads.robots import RobotSpec
from sim.files.robot_file import load_robot
from sim.mujoco_world import MODELS

SLIDES = """      <joint name="base_x" type="slide" axis="1 0 0"/>
      <joint name="base_y" type="slide" axis="0 1 0"/>
      <joint name="base_yaw" type="hinge" axis="0 0 1"/>
"""
WHEELS = """      <freejoint name="base"/>
      <geom name="front" type="sphere" size="0.0175" pos="0.16 0 0.0175" mass="0.05" condim="1"
            friction="0 0 0" priority="2"/>
      <geom name="rear" type="sphere" size="0.0175" pos="-0.16 0 0.0175" mass="0.05" condim="1"
            friction="0 0 0" priority="2"/>
"""
WHEEL = """      <body name="{name}" pos="0 {y} 0.035">
        <joint name="{name}" axis="0 1 0" damping="0.01" armature="0.002"/>
        <geom type="ellipsoid" size="0.035 0.012 0.035" mass="0.2" friction="1.2 0.005 0.0001"
              priority="1" condim="4"/>
      </body>
"""
SERVOS = """    <velocity name="base_x" joint="base_x" kv="800" forcerange="-250 250"/>
    <velocity name="base_y" joint="base_y" kv="800" forcerange="-250 250"/>
    <velocity name="base_yaw" joint="base_yaw" kv="150" forcerange="-80 80"/>
"""
MOTORS = """    <velocity name="left_wheel" joint="left_wheel" kv="4" forcerange="-8 8"/>
    <velocity name="right_wheel" joint="right_wheel" kv="4" forcerange="-8 8"/>
"""
BASE = """base:
  kind: differential
  joints: [base, left_wheel, right_wheel]
  actuators: [left_wheel, right_wheel]
  wheel_radius_m: 0.035
  wheel_separation_m: 0.3
"""


def wheeled_arm(folder: Path) -> RobotSpec:
    """Writes its model into a folder."""
    mjcf = (MODELS / "hsr.xml").read_text(encoding="utf-8")
    sides = (("left", 0.15), ("right", -0.15))
    wheels = "".join(WHEEL.format(name=f"{side}_wheel", y=y) for side, y in sides)
    mjcf = mjcf.replace(SLIDES, WHEELS + wheels).replace(SERVOS, MOTORS)
    (folder / "wheeled.xml").write_text(mjcf, encoding="utf-8")
    about = (MODELS / "hsr.model.yaml").read_text(encoding="utf-8")
    tail = about[about.index("radius_m:") :]
    (folder / "wheeled.model.yaml").write_text(BASE + tail, encoding="utf-8")
    return msgspec.structs.replace(load_robot("hsr"), robot="wheeled", model="wheeled")
