"""The simulated world: physics or event by event, robots' controllers, and ground truth.

    from sim import load_mission, make_backend

Files are read without numpy and MuJoCo.
"""

from typing import TYPE_CHECKING

from keyexpr_schema.lazy import lazy_names

if TYPE_CHECKING:
    from sim.backend import Backend as Backend
    from sim.embodiment import SimEmbodiment as SimEmbodiment
    from sim.embodiment import sim_embodiment as sim_embodiment
    from sim.errors import BadFile as BadFile
    from sim.errors import SimError as SimError
    from sim.errors import WorldRuns as WorldRuns
    from sim.files.mission_file import Mission as Mission
    from sim.files.mission_file import load_mission as load_mission
    from sim.files.mission_file import load_robot as load_robot
    from sim.files.world_file import load_world as load_world
    from sim.files.world_payloads import object_payloads as object_payloads
    from sim.files.world_payloads import place_payloads as place_payloads
    from sim.files.world_schema import WorldFile as WorldFile
    from sim.kinematic.backend import KinematicBackend as KinematicBackend
    from sim.kinematic.backend import MotionModel as MotionModel
    from sim.mujoco_world.backend import MujocoBackend as MujocoBackend
    from sim.server.process import make_backend as make_backend
    from sim.server.process import run_simulation as run_simulation
    from sim.server.sim_server import SimServer as SimServer
else:
    __all__, __getattr__ = lazy_names(
        __name__,
        {
            "backend": "Backend",
            "embodiment": "SimEmbodiment sim_embodiment",
            "errors": "BadFile SimError WorldRuns",
            "files.mission_file": "Mission load_mission load_robot",
            "files.world_file": "load_world",
            "files.world_payloads": "object_payloads place_payloads",
            "files.world_schema": "WorldFile",
            "kinematic.backend": "KinematicBackend MotionModel",
            "mujoco_world.backend": "MujocoBackend",
            "server.process": "make_backend run_simulation",
            "server.sim_server": "SimServer",
        },
    )
