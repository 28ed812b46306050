"""Robots count what lies where: one plug-in of each kind."""

from pathlib import Path

SKILL_FILE = Path(__file__).with_name("skills.yaml")
"""What planners know of the skill; what a robot does is in `stocktaking.skill`."""
