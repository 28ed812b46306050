"""`Embodiment`: the one thing to write to put another robot, simulated or real, behind a worker.

A worker owns exactly one embodiment and drives one motion at a time. Everything above it (skills,
retries, the journal, reports) is the same for every robot; everything below it (navigation,
control, perception) is the embodiment's own business. Behind it may stand a simulator, a ROS 2
action client, or a vendor's API.

To put a real robot behind it, map each `MotionKind` to what the robot offers (`GO_TO` and
`APPROACH` to its navigation, `LOOK` to its detector, `GRASP`, `RELEASE`, `RELEASE_IN_BASKET` and
`STOW` to its arm, `OPEN`, `SWITCH_ON`, `PLACE_AT`, `HAND_OVER` and the like to what does that as a
whole), and answer a kind that the robot does not have with a `FAILED` outcome whose
`reason` says so. Then offer a factory of it as an entry point in the group
`robotfleet.embodiments` (`robotctl worker --embodiment NAME`), or pass it to `run_worker`.
"""

from __future__ import annotations

from contextlib import AbstractAsyncContextManager
from typing import Any, Protocol, runtime_checkable

from keyexpr_schema.errors import BrokenPlugIn, SchemaError
from keyexpr_schema.payloads.motions import Motion, MotionOutcome, Senses
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.plug_ins import load_plug_in
from keyexpr_schema.transport.session import Session
from workers.errors import WorkerError

EMBODIMENTS = "robotfleet.embodiments"
"""Entry-point group: each entry is an `EmbodimentFactory`."""


@runtime_checkable
class Embodiment(Protocol):
    """A robot's body, as a worker drives it.

    Metres and radians in the world frame (x east, y north, z up); seconds on the fleet's clock.
    All methods are called from one asyncio event loop and must not block it.
    """

    @property
    def robot(self) -> str:
        """The robot's id."""
        ...

    async def perform(self, motion: Motion) -> MotionOutcome:
        """Carry out `motion` and return when it has ended.

        What goes wrong in the world (no path, nothing in the hand, `motion.timeout_s` over) is a
        value: an outcome with state `FAILED` and a sentence in `reason`. The state is never
        `RUNNING`. A motion must be carried out at most once even if the link to the driver
        stutters, and the robot must be at rest when an outcome is returned.

        Being cancelled (`asyncio.CancelledError`) stops the motion: the robot comes to rest and
        keeps in its hand what it holds.

        Raises:
            RobotUnreachable: the driver does not answer; whether the robot moved is unknown.
        """
        ...

    async def senses(self) -> Senses:
        """What the robot knows of itself without looking. Callable while a motion runs.

        Raises:
            RobotUnreachable: the driver does not answer.
        """
        ...

    async def stop(self) -> None:
        """Bring the robot to rest, whatever it is doing, without opening its hand; return when it
        rests. That is what people are told who stop it: not that it was asked to.

        Raises:
            RobotUnreachable: the driver does not answer, or the robot does not come to rest.
        """
        ...

    def now_s(self) -> float:
        """Seconds on the fleet's clock: simulated time, or a clock that all robots share."""
        ...


@runtime_checkable
class SensingEmbodiment(Embodiment, Protocol):
    """An embodiment whose driver says by itself what the sensors give: then nobody has to ask."""

    async def next_senses(self) -> Senses:
        """The next reading: soon after something changed, else every second or so.

        A reading that nobody waited for may be passed over for a later one.
        """
        ...


@runtime_checkable
class YieldingEmbodiment(Embodiment, Protocol):
    """An embodiment whose driver moves a robot that does nothing out of others' way. After `stop`
    it must not, before the robot's next motion or `release`."""

    async def release(self) -> None:
        """It may be moved out of others' way again.

        Raises:
            RobotUnreachable: the driver does not answer.
        """
        ...


class EmbodimentFactory(Protocol):
    """Makes a robot's embodiment. One that is an async context manager is entered and left."""

    def __call__(self, session: Session, spec: RobotSpec, incarnation: str, /) -> Embodiment:
        """For the run `incarnation` of a worker: what an earlier run had begun is stopped."""
        ...


def installed_embodiment(name: str) -> EmbodimentFactory:
    """The factory that an installed package offers by that name.

    Raises:
        BrokenPlugIn: there is none, or it is not callable; and so does the factory where it makes
            no embodiment.
    """

    def accept(offered: Any) -> EmbodimentFactory:
        if not callable(offered):
            raise TypeError(f"{offered!r} is no EmbodimentFactory: it cannot be called")
        return offered  # type: ignore[no-any-return]

    factory = load_plug_in(EMBODIMENTS, name, accept)

    def make(session: Session, spec: RobotSpec, incarnation: str, /) -> Embodiment:
        try:
            made = factory(session, spec, incarnation)
        except (WorkerError, SchemaError):
            raise
        except Exception as error:  # a stranger's constructor
            raise BrokenPlugIn(
                f"embodiment {name!r} cannot be made: {type(error).__name__}: {error}"
            ) from error
        if not isinstance(made, (Embodiment, AbstractAsyncContextManager)):
            raise BrokenPlugIn(f"embodiment {name!r} is {made!r}, which is no Embodiment")
        return made

    return make
