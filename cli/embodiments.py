"""What can drive a robot: the simulation, or a class from a user's package.

A plug-in is an entry point in the group `robotfleet.embodiments` that is an `EmbodimentFactory`:
called with `(session, spec, incarnation)` it returns an `Embodiment`.
"""

from __future__ import annotations

from importlib.metadata import entry_points
from typing import TYPE_CHECKING, cast

from cli.errors import check_known

if TYPE_CHECKING:
    from keyexpr_schema.payloads.robots import RobotSpec
    from keyexpr_schema.transport.session import Session
    from workers.embodiment import Embodiment, EmbodimentFactory

GROUP = "robotfleet.embodiments"
SIM = "sim"


def embodiment_factory(name: str) -> EmbodimentFactory:
    """The factory of that name.

    Raises:
        Unknown: there is none; the message lists those there are.
    """
    found = {entry.name: entry for entry in entry_points(group=GROUP)}
    check_known("embodiment", name, [SIM, *found])
    if name in found:
        return cast("EmbodimentFactory", found[name].load())
    from sim.embodiment import SimEmbodiment

    def simulated(session: Session, spec: RobotSpec, incarnation: str) -> Embodiment:
        return SimEmbodiment(session, spec.robot, incarnation)

    return simulated
