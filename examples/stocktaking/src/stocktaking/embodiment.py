"""The embodiment `rehearsal`: a robot of words, to try a plan before a real one moves.

It is where it was last sent, at once, and sees what the facts say is there. Where this one answers
`_done`, a real one waits for its robot's navigation, camera and arm.
"""

from __future__ import annotations

import time

from keyexpr_schema import (
    AT,
    FACT,
    OBJECT,
    PLACE,
    Detection,
    Motion,
    MotionKind,
    MotionOutcome,
    MotionState,
    PlaceAddress,
    PoseMRad,
    RobotSpec,
    Senses,
    Session,
)


class Rehearsal:
    """An `Embodiment`; the class itself is the `EmbodimentFactory`."""

    def __init__(self, session: Session, spec: RobotSpec, incarnation: str) -> None:
        self.robot = spec.robot
        self._session = session
        self._place: str | None = None
        self._pose_m_rad: PoseMRad = (0.0, 0.0, 0.0)

    def now_s(self) -> float:
        """The host's clock, which all robots share."""
        return time.time()

    async def senses(self) -> Senses:
        """Where it is."""
        return Senses(
            robot=self.robot,
            time_s=self.now_s(),
            pose_m_rad=self._pose_m_rad,
            place=self._place,
        )

    async def stop(self) -> None:
        """It never moves for longer than a moment."""

    async def perform(self, motion: Motion) -> MotionOutcome:
        """What goes wrong is an outcome with a sentence, not an exception."""
        if motion.kind is MotionKind.GO_TO and motion.place is not None:
            place = await self._session.get(PLACE, PlaceAddress(motion.place))
            if place is None or not place.region_m:
                return await self._done(f"nobody knows where {motion.place} is")
            x_min, y_min, x_max, y_max = place.region_m[0]
            self._pose_m_rad = ((x_min + x_max) / 2, (y_min + y_max) / 2, 0.0)
            self._place = place.place
            return await self._done()
        if motion.kind is MotionKind.LOOK:
            return await self._done(detections=await self._look())
        if motion.kind is MotionKind.STOW:
            return await self._done()
        return await self._done(f"a rehearsal has no hand for {motion.kind.value}")

    async def _look(self) -> tuple[Detection, ...]:
        facts = await self._session.list(FACT, relation=AT)
        objects = await self._session.list(OBJECT)
        x_m, y_m, _ = self._pose_m_rad
        return tuple(
            Detection(
                object=thing.object, kind=thing.kind, point_m=(x_m, y_m, 0.0), place=self._place
            )
            for thing in objects.values()
            if any(
                fact.subject == thing.object and fact.value == self._place
                for fact in facts.values()
            )
        )

    async def _done(
        self, reason: str | None = None, detections: tuple[Detection, ...] = ()
    ) -> MotionOutcome:
        return MotionOutcome(
            state=MotionState.SUCCEEDED if reason is None else MotionState.FAILED,
            senses=await self.senses(),
            reason=reason,
            detections=detections,
        )
