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

RESTS_WITHIN_S = 10.0
"""Simulated time after which a robot that was halted, and still moves, is said not to rest."""

_TOLD = "it was told to stop"


class MotionCalls:
    """The calls of one robot, in front of a backend. Wall times are of the caller's clock.

    While `stops` hold the robot, none of its motions begins. No motion has ended, and no stop is
    answered, before the robot rests.
    """

    def __init__(self, backend: Backend, robot: str, stops: StopSwitch) -> None:
        self.robot = robot
        self._backend = backend
        self._stops = stops
        self._incarnation: str | None = None
        self._superseded: set[str] = set()
        self._active: str | None = None
        self._halted_s: float | None = None
        """Simulated time since when it is to come to rest."""
        self._told: str | None = None
        """Why its motion was halted; `None`: it ended by itself."""
        self._stopping: list[str] = []
        """Stops that are answered when it rests."""
        self._stays = False
        """Its worker has told it to stay where it is."""
        self._was_stopped = False
        self._ended: OrderedDict[str, MotionOutcome] = OrderedDict()
        self._changed = asyncio.Event()
        self._waiting = 0
        self._asked_at_s = 0.0
        self.held_until_s = 0.0
        """The world waits that long for the robot's next call."""

    @property
    def active(self) -> bool:
        """A motion runs, or the robot does not rest yet."""
        return self._active is not None or self._halted_s is not None

    def holds(self, now_s: float) -> bool:
        """The world waits for the robot's next call, as far as it can afford that."""
        return not self.active and now_s < self.held_until_s

    def accept(self, call: MotionCall, now_s: float) -> MotionOutcome | None:
        """Do what `call` says; its answer, or `None` while its motion runs, or its robot brakes."""
        if call.incarnation in self._superseded:
            return self._refusal("a newer run of this robot's worker drives it")
        if call.incarnation != self._incarnation:
            if self._incarnation is not None:
                self._superseded.add(self._incarnation)
                self.stop("a newer run of this robot's worker took over")
                self._stay(False)
            self._incarnation = call.incarnation
        self._asked_at_s = now_s
        if call.stop:
            return self._stop_call(call)
        if call.release:
            self._stay(False)
        if call.call in self._ended:
            return self._ended[call.call]
        if call.motion is None:
            return MotionOutcome(
                state=MotionState.SUCCEEDED, senses=self._backend.senses(self.robot)
            )
        if self._stops.held:
            return self._refusal(str(self._stops.held), MotionState.STOPPED)
        if call.call != self._active:
            self._give_way()
            self._stay(False)
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
                while call.call == self._active or call.call in self._stopping:
                    await self._changed.wait()
        except TimeoutError:
            pass
        finally:
            self._waiting -= 1
            self._asked_at_s = clock.time()
        return self._ended.get(call.call) or self._running()

    def settle(self, now_s: float, grace_s: float) -> bool:
        """Notice that the motion has ended and the robot rests; whether it does now. After a motion
        that ended by itself the world then waits `grace_s`."""
        backend = self._backend
        if not self.active or backend.is_running(self.robot):
            return False
        if self._halted_s is None:
            self._halted_s = backend.time_s
        rests = backend.rests(self.robot)
        if not rests and backend.time_s - self._halted_s < RESTS_WITHIN_S:
            return False
        if self._told is None:
            self.held_until_s = now_s + grace_s
        if self._active is not None:
            self._remember(self._active, self._outcome())
        stopped = self._refusal(_TOLD, MotionState.STOPPED)
        for name in self._stopping:
            # Should the motion of this call still be on its way, it comes too late.
            self._remember(name, stopped if rests else self._refusal("it does not come to rest"))
        self._end()
        return True

    def abandoned(self, now_s: float, patience_s: float) -> bool:
        """Nobody has asked about the running motion for `patience_s`."""
        idle_s = now_s - self._asked_at_s
        runs = self._active is not None and self._told is None
        return runs and self._waiting == 0 and idle_s > patience_s

    def postpone_watchdog(self, now_s: float) -> None:
        """Nobody could ask until now: that counts against nobody."""
        self._asked_at_s = max(self._asked_at_s, now_s)

    def obey_stops(self) -> None:
        """Come to rest and stay, if an emergency stop holds the robot, and until it is over."""
        held = self._stops.held
        if held:
            self._halt(str(held))
        elif self._was_stopped:
            self._stays = False
        self._was_stopped = bool(held)
        self._stay(self._stays)

    def stop(self, reason: str) -> None:
        """Stop the running motion, if there is one; it ends when the robot rests."""
        if self._active is not None:
            self._halt(reason)

    def _stop_call(self, call: MotionCall) -> MotionOutcome | None:
        if call.call in self._ended:
            return self._ended[call.call]
        if call.call != self._active and call.call not in self._stopping:
            self._stopping.append(call.call)
            self._stay(True)
        self._halt(_TOLD)
        return self._ended.get(call.call)

    def _stay(self, stays: bool) -> None:
        self._stays = stays
        self._backend.hold(self.robot, stays or bool(self._stops.held))

    def _halt(self, reason: str) -> None:
        self._backend.stop(self.robot)
        if self._told is None:
            self._told, self._halted_s = reason, self._backend.time_s
        self.settle(0.0, 0.0)  # the world waits for nobody whose motion was halted

    def _give_way(self) -> None:
        """End what has not ended yet, for a motion that takes its place."""
        if not self.active:
            return
        self._backend.stop(self.robot)
        self._told = self._told or "another motion took its place"
        if self._active is not None:
            self._remember(self._active, self._outcome())
        for name in self._stopping:
            self._remember(name, self._refusal(self._told))
        self._end()

    def _outcome(self) -> MotionOutcome:
        """Of the motion that has ended, with what the robot senses where it rests."""
        found = self._backend.outcome(self.robot)
        assert found is not None, "a motion that was begun has an outcome"
        if self._told and found.state in (MotionState.RUNNING, MotionState.STOPPED):
            return self._refusal(self._told, MotionState.STOPPED)
        return msgspec.structs.replace(found, senses=self._backend.senses(self.robot))

    def _end(self) -> None:
        self._active = self._halted_s = self._told = None
        self._stopping.clear()
        self._changed.set()
        self._changed = asyncio.Event()

    def _remember(self, call: str, outcome: MotionOutcome) -> None:
        self._ended[call] = outcome
        while len(self._ended) > REMEMBERED:
            self._ended.popitem(last=False)

    def _running(self) -> MotionOutcome:
        return self._refusal(None, MotionState.RUNNING)

    def _refusal(
        self, reason: str | None, state: MotionState = MotionState.FAILED
    ) -> MotionOutcome:
        return MotionOutcome(state=state, senses=self._backend.senses(self.robot), reason=reason)
