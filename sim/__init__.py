"""The simulated world: physics or event by event, robots' controllers, and ground truth.

    from sim import load_mission, make_backend

Files are read without MuJoCo, those of robots without numpy, too.
"""

from typing import TYPE_CHECKING

from keyexpr_schema.lazy import lazy_names

if TYPE_CHECKING:
    from sim.backend import *  # noqa: F403
    from sim.embodiment import *  # noqa: F403
    from sim.errors import *  # noqa: F403
    from sim.files.mission_file import *  # noqa: F403
    from sim.files.robot_file import *  # noqa: F403
    from sim.files.world_file import *  # noqa: F403
    from sim.files.world_payloads import *  # noqa: F403
    from sim.files.world_schema import *  # noqa: F403
    from sim.kinematic.backend import *  # noqa: F403
    from sim.mujoco_world.backend import *  # noqa: F403
    from sim.server.process import *  # noqa: F403
    from sim.server.sim_server import *  # noqa: F403
else:
    __all__, __getattr__, __dir__ = lazy_names(
        __name__,
        {
            "backend": "Backend",
            "embodiment": "SimEmbodiment sim_embodiment",
            "errors": "BadFile SimError WorldRuns",
            "files.mission_file": "Mission load_mission",
            "files.robot_file": "load_robot",
            "files.world_file": "load_world",
            "files.world_payloads": "object_payloads place_payloads region_payloads",
            "files.world_schema": "WorldFile",
            "kinematic.backend": "KinematicBackend MotionModel",
            "mujoco_world.backend": "MujocoBackend",
            "server.process": "make_backend run_simulation",
            "server.sim_server": "SimServer",
        },
    )
