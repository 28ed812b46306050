"""One robot's calls: each carried out once, only for the newest run of its worker."""

from __future__ import annotations

import asyncio
from collections import OrderedDict

import msgspec

from keyexpr_schema.payloads.motions import MotionOutcome, MotionState
from keyexpr_schema.payloads.simulation import MotionCall
from sim.backend import Backend
from workers.stops import StopSwitch

REMEMBERED = 256
"""Ended calls that are still answered when they are asked again."""


class MotionCalls:
    """The calls of one robot, in front of a backend. Wall times are of the caller's clock.

    While `stops` hold the robot, none of its motions begins.
    """

    def __init__(self, backend: Backend, robot: str, stops: StopSwitch) -> None:
        self.robot = robot
        self._backend = backend
        self._stops = stops
        self._incarnation: str | None = None
        self._superseded: set[str] = set()
        self._active: str | None = None
        self._ended: OrderedDict[str, MotionOutcome] = OrderedDict()
        self._changed = asyncio.Event()
        self._waiting = 0
        self._asked_at_s = 0.0
        self.held_until_s = 0.0
        """The world waits that long for the robot's next call."""

    @property
    def active(self) -> bool:
        """A motion runs."""
        return self._active is not None

    @property
    def is_stopped(self) -> bool:
        """An emergency stop holds the robot."""
        return bool(self._stops.held)

    def holds(self, now_s: float) -> bool:
        """The world waits for the robot's next call, as far as it can afford that."""
        return not self.active and now_s < self.held_until_s

    def accept(self, call: MotionCall, now_s: float) -> MotionOutcome | None:
        """Do what `call` says; its answer, or `None` while its motion runs."""
        if call.incarnation in self._superseded:
            return self._refusal("a newer run of this robot's worker drives it")
        if call.incarnation != self._incarnation:
            if self._incarnation is not None:
                self._superseded.add(self._incarnation)
                self.stop("a newer run of this robot's worker took over")
            self._incarnation = call.incarnation
        self._asked_at_s = now_s
        if call.stop:
            return self._stop_call(call)
        if call.call in self._ended:
            return self._ended[call.call]
        if call.motion is None:
            return MotionOutcome(
                state=MotionState.SUCCEEDED, senses=self._backend.senses(self.robot)
            )
        if self._stops.held:
            return self._refusal(str(self._stops.held), MotionState.STOPPED)
        if call.call != self._active:
            self.stop("another motion took its place")
            self._backend.begin(self.robot, call.motion)
            self._active = call.call
            self.held_until_s = 0.0
            self.settle(now_s, 0.0)
        return self._ended.get(call.call)

    async def answer(self, call: MotionCall, clock: asyncio.AbstractEventLoop) -> MotionOutcome:
        """The outcome of `call`, as soon as it has ended or after its `wait_s`."""
        outcome = self.accept(call, clock.time())
        if outcome is not None:
            return outcome
        self._waiting += 1
        try:
            async with asyncio.timeout(max(0.0, min(call.wait_s, 30.0))):
                while call.call == self._active:
                    await self._changed.wait()
        except TimeoutError:
            pass
        finally:
            self._waiting -= 1
            self._asked_at_s = clock.time()
        return self._ended.get(call.call) or self._running()

    def settle(self, now_s: float, grace_s: float) -> bool:
        """Notice that the motion has ended; whether it did. The world then waits `grace_s`."""
        if self._active is None or self._backend.is_running(self.robot):
            return False
        outcome = self._backend.outcome(self.robot)
        assert outcome is not None, "a motion that was begun has an outcome"
        self._end(outcome)
        self.held_until_s = now_s + grace_s
        return True

    def abandoned(self, now_s: float, patience_s: float) -> bool:
        """Nobody has asked about the running motion for `patience_s`."""
        idle_s = now_s - self._asked_at_s
        return self.active and self._waiting == 0 and idle_s > patience_s

    def postpone_watchdog(self, now_s: float) -> None:
        """Nobody could ask until now: that counts against nobody."""
        self._asked_at_s = max(self._asked_at_s, now_s)

    def obey_stops(self) -> None:
        """Stop the running motion, if an emergency stop holds the robot."""
        if self._stops.held:
            self.stop(str(self._stops.held))

    def _stop_call(self, call: MotionCall) -> MotionOutcome:
        if call.call in self._ended:
            return self._ended[call.call]
        if self._active is not None:
            # A stop with a name of its own stops whatever runs.
            self.stop("it was told to stop")
        else:
            self._backend.stop(self.robot)
        if call.call not in self._ended:
            # Should the motion of this call still be on its way, it comes too late.
            self._remember(call.call, self._refusal("it was told to stop", MotionState.STOPPED))
        return self._ended[call.call]

    def stop(self, reason: str) -> None:
        """Stop the running motion, if there is one."""
        if self._active is None:
            return
        self._backend.stop(self.robot)
        outcome = self._backend.outcome(self.robot)
        if outcome is None or outcome.state in (MotionState.RUNNING, MotionState.STOPPED):
            outcome = self._refusal(reason, MotionState.STOPPED)
        self._end(outcome)

    def _end(self, outcome: MotionOutcome) -> None:
        assert self._active is not None
        self._remember(self._active, outcome)
        self._active = None
        self._changed.set()
        self._changed = asyncio.Event()

    def _remember(self, call: str, outcome: MotionOutcome) -> None:
        self._ended[call] = outcome
        while len(self._ended) > REMEMBERED:
            self._ended.popitem(last=False)

    def _running(self) -> MotionOutcome:
        outcome = self._backend.outcome(self.robot)
        assert outcome is not None
        return msgspec.structs.replace(outcome, state=MotionState.RUNNING)

    def _refusal(self, reason: str, state: MotionState = MotionState.FAILED) -> MotionOutcome:
        return MotionOutcome(state=state, senses=self._backend.senses(self.robot), reason=reason)
