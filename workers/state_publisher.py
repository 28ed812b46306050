"""Publishes a robot's state: at once when it changes, at 2 Hz while it drives."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from contextlib import suppress
from math import ceil, dist

from keyexpr_schema.errors import SchemaError
from keyexpr_schema.ids import Id
from keyexpr_schema.keyspace import ROBOT_STATE
from keyexpr_schema.payloads.motions import Senses
from keyexpr_schema.payloads.robots import RobotActivity, RobotAddress, RobotState, charge_step
from keyexpr_schema.payloads.tasks import Order
from keyexpr_schema.payloads.waits import WaitReason
from keyexpr_schema.transport.clock_skew import wrong
from keyexpr_schema.transport.session import Session
from workers.embodiment import Embodiment, SensingEmbodiment
from workers.errors import RobotUnreachable

SENSE_S = 0.2
"""Wall seconds between two readings of the sensors of a robot that is at work, or moves."""
IDLE_SENSE_S = 1.0
"""The same, for one that stands about: only being pushed or filled changes what it senses."""
QUIET_S = 5.0
"""A driver that says by itself what the sensors give is asked after so long without a word."""
DRIVING_S = 0.5
"""Wall seconds between two states of which only the pose differs."""
REPEAT_S = 20.0
"""Wall seconds after which a state is put again, should it have been lost in spite of all."""
PATIENCE_S = 3.0
"""Wall seconds after which sensors that do not answer count as silent."""
STOOD_STILL_M = 0.01


class StatePublisher:
    """What everybody may know of this robot. `activity` and `order` are set by its worker."""

    def __init__(
        self,
        session: Session,
        embodiment: Embodiment,
        incarnation: str,
        on_charge: Callable[[int], bool] = lambda percent: True,
        is_registered: Callable[[], bool] = lambda: True,
        waits: Callable[[], tuple[WaitReason, ...]] = tuple,
    ) -> None:
        """`on_charge` is told how full the battery is, in steps of some percent, whenever that
        changes, and again until it has taken that in. Of a robot that is not registered nothing
        is published: it has been forgotten. `waits`: what keeps it from its order now."""
        self._session = session
        self._embodiment = embodiment
        self._incarnation = incarnation
        self._activity = RobotActivity.RECOVERING
        self._order: Order | None = None
        self._stops: tuple[Id, ...] = ()
        self._trouble: str | None = None
        self._refused: str | None = None
        self._senses: Senses | None = None
        self._sent: RobotState | None = None
        self._sent_wall_s = 0.0
        self._on_charge = on_charge
        self._is_registered = is_registered
        self._waits = waits
        self._charge: int | None = None
        self._silent = False
        self._stirred = asyncio.Event()
        self._log = logging.getLogger(f"robotfleet.worker.{embodiment.robot}")

    def set_activity(self, activity: RobotActivity, order: Order | None = None) -> None:
        """Set what the robot does; published at once."""
        self._activity, self._order = activity, order
        self._stirred.set()
        self._publish()

    def set_trouble(self, trouble: str | None) -> None:
        """Set what keeps the worker from working; published at once."""
        self._trouble = trouble
        self._publish()

    def set_refused(self, why: str | None) -> None:
        """Set why the store does not take in what the worker reports; published at once."""
        robot = self._embodiment.robot
        self._refused = why and f"what the worker of {robot} reports is not taken in: {why}"
        self._publish()

    async def set_stops(self, stops: tuple[Id, ...]) -> None:
        """Set which emergency stops the robot rests by; published at once, with where it rests."""
        await self.read_senses()
        self._stops = stops
        self._publish()

    async def read_senses(self) -> None:
        """Read the sensors once, now; what changed goes out."""
        try:
            async with asyncio.timeout(PATIENCE_S):
                senses = await self._embodiment.senses()
        except (RobotUnreachable, SchemaError, TimeoutError) as error:
            if not self._silent:
                self._log.warning("the robot's sensors give nothing: %s", str(error) or "no answer")
            self._silent = True
            self._publish()
        else:
            self._take(senses)

    async def run(self) -> None:
        """Follow the sensors and publish for ever; ends by being cancelled."""
        connections = self._session.connections
        body = self._embodiment
        driver = body if isinstance(body, SensingEmbodiment) else None
        await self.read_senses()
        while True:
            await (self._polled() if driver is None else self._heard(driver))
            if self._session.connections != connections:
                # What was put while no router was there is lost.
                connections = self._session.connections
                self._sent = None
                self._publish()

    async def _heard(self, driver: SensingEmbodiment) -> None:
        """Take in what the driver says next; ask it where it says nothing."""
        try:
            async with asyncio.timeout(QUIET_S):
                senses = await driver.next_senses()
        except TimeoutError:
            await self.read_senses()
        else:
            self._take(senses)

    async def _polled(self) -> None:
        """Ask again, sooner while the robot is at work."""
        before = self._senses
        await self.read_senses()
        senses = self._senses
        stands = before is None or senses is None or before.pose_m_rad == senses.pose_m_rad
        idle = self._activity is RobotActivity.IDLE and stands
        self._stirred.clear()
        with suppress(TimeoutError):
            async with asyncio.timeout(IDLE_SENSE_S if idle else SENSE_S):
                await self._stirred.wait()

    def _take(self, senses: Senses) -> None:
        known, now_s = self._senses, self._embodiment.now_s()
        # What says that it is from later than now keeps nothing out.
        if known is None or self._silent or not senses.time_s < known.time_s <= now_s:
            known = self._senses = senses
        self._silent = False
        self._tell_charge(known)
        self._publish()

    def _tell_charge(self, senses: Senses) -> None:
        step = None if senses.charge is None else charge_step(senses.charge)
        if step is not None and step != self._charge and self._on_charge(step):
            self._charge = step

    def _publish(self) -> None:
        if not self._is_registered():
            self._sent = None
            return
        state, now = self._state(), asyncio.get_running_loop().time()
        age_s = now - self._sent_wall_s
        if age_s < REPEAT_S and not _differs(self._sent, state, age_s):
            return
        self._session.put(ROBOT_STATE, RobotAddress(state.robot), state)
        self._sent, self._sent_wall_s = state, now

    def _wrong_clock(self) -> str | None:
        skew = self._session.clock.latest
        return wrong(skew) if skew is not None and skew.too_much else None

    def _clock_ahead_s(self) -> float:
        skew = self._session.clock.latest
        return round(skew.ahead_s, 1) if skew is not None and skew.worth_saying else 0.0

    def _state(self) -> RobotState:
        senses, order = self._senses, self._order
        return RobotState(
            robot=self._embodiment.robot,
            incarnation=self._incarnation,
            activity=self._activity,
            pose_m_rad=None if senses is None else senses.pose_m_rad,
            place=None if senses is None else senses.place,
            holding=None if senses is None else senses.holding,
            basket=() if senses is None else senses.basket,
            plan=None if order is None else order.plan,
            task=None if order is None else order.task,
            stops=self._stops,
            time_s=self._embodiment.now_s() if senses is None else senses.time_s,
            charge=None if senses is None else senses.charge,
            trouble=self._trouble or self._refused or self._wrong_clock(),
            clock_ahead_s=self._clock_ahead_s(),
            waits_for=self._waits(),
        )


def _differs(sent: RobotState | None, state: RobotState, age_s: float) -> bool:
    """Whether `state` is worth publishing `age_s` after the one that was sent last.

    The pose is compared on the floor plan only: a robot that turns on the spot stays where it is
    for everybody else.
    """
    if sent is None or _discrete(sent) != _discrete(state):
        return True
    if age_s < DRIVING_S or state.pose_m_rad is None or sent.pose_m_rad is None:
        return sent.pose_m_rad is None and state.pose_m_rad is not None
    return dist(sent.pose_m_rad[:2], state.pose_m_rad[:2]) > STOOD_STILL_M


def _discrete(state: RobotState) -> tuple[object, ...]:
    """All but pose and time, the charge by whole percents."""
    return (
        state.activity,
        state.place,
        state.holding,
        state.basket,
        state.plan,
        state.task,
        state.stops,
        state.trouble,
        state.clock_ahead_s,
        state.waits_for,
        None if state.charge is None else ceil(state.charge),
    )
