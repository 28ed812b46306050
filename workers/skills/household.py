"""The skills that come with RobotFleet."""

from __future__ import annotations

from workers.skill_registry import Skill
from workers.skills.navigate import navigate
from workers.skills.pick import pick
from workers.skills.place import place
from workers.skills.place_on_robot import place_on_robot
from workers.skills.search import search

HOUSEHOLD: tuple[Skill, ...] = (navigate, search, pick, place, place_on_robot)
"""Every worker has these."""
