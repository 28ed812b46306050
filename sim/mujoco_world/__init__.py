"""One shared physical world in MuJoCo: robots that drive, see, grasp by friction and carry."""

from __future__ import annotations

from sim.mujoco_world.backend import MujocoBackend
from sim.mujoco_world.description import MODELS, Description, load_description

__all__ = ["MODELS", "Description", "MujocoBackend", "load_description"]
