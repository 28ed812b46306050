"""One mission: the planner's core and planning jobs, robots with real skills, a kinematic world."""

from __future__ import annotations

import asyncio
import time
from collections import deque
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from msgspec.structs import replace

from benchmarks.planning.embodiments import KinematicEmbodiment, SharedWorld
from benchmarks.planning.expectations import GroundTruth
from benchmarks.planning.household_world import HouseholdWorld
from benchmarks.planning.mishaps import Mishap, Mishaps
from benchmarks.planning.missions import Mission
from benchmarks.planning.robot_worker import INCARNATION, RobotWorker
from benchmarks.planning.simulated_time import Deadlock, SimulatedLoop
from benchmarks.planning.tool_skills import TOOL_SKILLS
from fleet.core import events
from fleet.core.dispatch.dispatcher import next_timer
from fleet.core.effects import Effect, Interpret, MakePlan, Publish, Retract
from fleet.core.events import Event
from fleet.core.model.skills import phrases_of
from fleet.core.state import LOGIC, Policy, State
from fleet.core.step import step
from fleet.language import Confirm
from fleet.service.composition import Composition
from fleet.service.planning.planning_job import run_interpretation, run_planning_job
from fleet.service.task_files import load_all_tasks
from keyexpr_schema.facts import AT, ON
from keyexpr_schema.keyspace import FACT, OBJECT, ORDER, PLACE, ROBOT_SPEC, ROBOT_STATE
from keyexpr_schema.payloads.goals import GoalStatus
from keyexpr_schema.payloads.plans import ENDED_PLANS, PlanStatus
from keyexpr_schema.payloads.requests import Answer, PlanRequest
from keyexpr_schema.payloads.robots import RobotActivity, RobotAddress, RobotState
from keyexpr_schema.payloads.tasks import FINAL_REPORTS, Report, ReportState
from keyexpr_schema.payloads.world import (
    Fact,
    FactAddress,
    Feature,
    ObjectAddress,
    PlaceAddress,
    Statement,
)
from keyexpr_schema.transport.watch import Change
from sim.files.world_payloads import object_payloads
from sim.kinematic.backend import MotionModel
from workers.skill_registry import SkillRegistry
from workers.skills.household import HOUSEHOLD
from workers.world_cache import WorldCache

SEED = 7
MOST_SIMULATED_S = 7200.0
MOST_REVISIONS = 60


@dataclass
class Counts:
    """What a mission took. `planning_s` is CPU time, over all revisions."""

    tasks: int = 0
    failed_tasks: int = 0
    revisions: int = 0
    rounds: int = 0
    tokens: int = 0
    fallbacks: int = 0
    planning_s: float = 0.0
    reasons: list[str] = field(default_factory=list)
    """Why plans were not made, and why tasks failed."""


class FleetRun:
    """Planner and robots of one mission. Use: construct, then `await run()` on the loop."""

    def __init__(
        self,
        mission: Mission,
        composition: Composition,
        planner: str,
        strategy: str,
        loop: SimulatedLoop,
    ) -> None:
        self.mission = mission
        self.state = State()
        self.counts = Counts()
        self.stage = 0
        """How many of the mission's stages have held, in their order."""
        self.goals: dict[str, GoalStatus] = {}
        """What was last said of each goal: what is over leaves the planner's state."""
        self._plans: dict[str, PlanStatus] = {}
        self._answers: dict[str, Answer] = {}
        self._composition, self._planner, self._strategy = composition, planner, strategy
        self.backend = HouseholdWorld(
            mission.existing_world(),
            mission.robots,
            MotionModel(failures=mission.entry.failures),
            seed=SEED,
        )
        self.shared = SharedWorld(self.backend)
        self._ended: asyncio.Future[None] = loop.create_future()
        loop.drive(
            self._advance,
            lambda: self._fail(Deadlock("a deadlock: no motion runs and no timer is set")),
        )
        self._places = {place.place: place for place in mission.places}
        self._world = WorldCache()
        registry = SkillRegistry((*HOUSEHOLD, *TOOL_SKILLS))
        self._robots = {
            spec.robot: RobotWorker(
                spec,
                KinematicEmbodiment(self.shared, spec.robot),
                self._world,
                registry,
                self._receive,
            )
            for spec, _ in mission.robots
        }
        self._working: dict[str, asyncio.Future[None]] = {}
        self._mishaps = Mishaps(mission.entry)
        self._broken: dict[str, None] = {}
        self._pending: deque[Event] = deque()
        self._busy = False

    async def run(self) -> str | None:
        """Carry the mission out until nothing more happens; what went wrong with that, or `None`.

        What goes wrong with goals is in the state's goal and plan statuses.
        """
        self._introduce()
        for robot in self._robots.values():
            await robot.introduce_itself()
        self._put_beliefs()
        self._working = {
            name: asyncio.ensure_future(robot.work()) for name, robot in self._robots.items()
        }
        for goal in self.mission.goals:
            self._handle(events.GoalPut, goal=goal)
        request = PlanRequest(request="r1", planner=self._planner, strategy=self._strategy)
        self._handle(events.PlanRequested, request=request)
        self._observe_conduct()
        wrong: str | None = None
        try:
            if not self._done():
                await self._ended
        except (Deadlock, TimeoutError) as error:
            wrong = str(error)
        for task in self._working.values():
            task.cancel()
        with suppress(asyncio.CancelledError):
            await asyncio.gather(*self._working.values())
        self.counts.reasons += [plan.reason for plan in self._plans.values() if plan.reason]
        return wrong

    def ground_truth(self) -> GroundTruth:
        """What is really so now."""
        see_m = {spec.robot: spec.capabilities.get("see", 0.0) for spec, _ in self.mission.robots}
        return GroundTruth(
            objects={truth.object: truth for truth in self.backend.truths()},
            robots={robot: self.backend.senses(robot) for robot in self.backend.robots},
            places=self._places,
            believed=dict(self.state.vocabulary().whereabouts),
            looks=[(place, x, y, see_m[robot]) for place, x, y, robot in self.shared.looks],
            parts={name: thing.part_of for name, thing in self.backend.things.items()},
            state_of=self.backend.state_of,
        )

    def refusals(self) -> list[str]:
        """Why goals were not reached and requests were refused, as the fleet puts it."""
        reasons = [
            f"{status.goal}: {status.reason}" for status in self.goals.values() if status.reason
        ]
        reasons += [a.sentence for a in self._answers.values() if not a.accepted]
        reasons += [plan.reason for plan in self._plans.values() if plan.reason]
        return list(dict.fromkeys(reasons))

    # --- the world goes on -----------------------------------------------------------------------

    def _advance(self) -> float | None:
        before_s = self.backend.time_s
        passed_s = self.shared.advance()
        if passed_s is None and self._due_s() is not None:
            self.backend.advance()  # nothing moves, and time will change something
            passed_s = self.backend.time_s - before_s
        if passed_s is not None:
            self._update_robots()
            self._let_happen()
            self._observe_conduct()
            if self.backend.time_s > MOST_SIMULATED_S:
                self._fail(TimeoutError(f"not done after {MOST_SIMULATED_S:g} simulated seconds"))
        return passed_s

    def _due_s(self) -> float | None:
        """When time alone changes something."""
        times = (self._mishaps.next_s, next_timer(self.state))
        return min((at_s for at_s in times if at_s is not None), default=None)

    def _let_happen(self) -> None:
        """What goes wrong by now, and what the planner waits for."""
        for what, name in self._mishaps.due(self.backend.time_s):
            if what is Mishap.DIES:
                self._working[name].cancel()
                self._handle(events.WorkerDisconnected, robot=name, incarnation=INCARNATION)
            elif what is Mishap.UNREGISTERED:
                self._handle(events.RobotUnregistered, robot=name)
            else:
                self.backend.put(name, self.mission.entry.moves[name].to)
        due_s = next_timer(self.state)
        if due_s is not None and due_s <= self.backend.time_s:
            self._handle(events.TimerFired)

    def _observe_conduct(self) -> None:
        """Note which stages have come to be, and what holds that never should."""
        stages, ground_truth = self.mission.stages, self.ground_truth()
        while self.stage < len(stages) and all(
            ground_truth.satisfies(one) for one in stages[self.stage]
        ):
            self.stage += 1
        for one in self.mission.never:
            if ground_truth.satisfies(one):
                self._broken[f"it was so on the way: {one.text}"] = None
        for one in self.mission.always:
            if not ground_truth.satisfies(one):
                self._broken[f"it was not so on the way: {one.text}"] = None

    @property
    def misconduct(self) -> tuple[str, ...]:
        """What should have held all the time and did not, as sentences."""
        return tuple(self._broken)

    def _fail(self, error: Exception) -> None:
        if not self._ended.done():
            self._ended.set_exception(error)

    def _update_robots(self) -> None:
        for name in self._robots:
            senses = self.backend.senses(name)
            state = RobotState(
                robot=name,
                incarnation=INCARNATION,
                activity=RobotActivity.IDLE,
                pose_m_rad=senses.pose_m_rad,
                place=senses.place,
                holding=senses.holding,
                basket=senses.basket,
                time_s=senses.time_s,
            )
            if self._world.robots.get(name) != state:
                self._world.apply(Change(ROBOT_STATE, RobotAddress(name), state, ""))

    # --- what the planner receives ---------------------------------------------------------------

    def _introduce(self) -> None:
        policy = Policy(
            interpreter=self._composition.language_model.configured,
            confirm=Confirm.NEVER,
            skill_phrases=phrases_of(self.mission.skills),
            tasks=load_all_tasks(),
        )
        self._handle(
            events.PlannerStarted,
            epoch=1,
            incarnation=INCARNATION,
            policy=policy,
            skills=self.mission.skills,
            logic=LOGIC,
            lineage=INCARNATION,
        )
        for place in self._places.values():
            self._world.apply(Change(PLACE, PlaceAddress(place.place), place, ""))
            self._handle(events.PlacePut, place=place)
        for thing in object_payloads(self.mission.world):
            self._world.apply(Change(OBJECT, ObjectAddress(thing.object), thing, ""))
            self._handle(events.ObjectPut, object=thing)
        for spec, _ in self.mission.robots:
            self._world.apply(Change(ROBOT_SPEC, RobotAddress(spec.robot), spec, ""))
            self._handle(events.RobotRegistered, spec=spec)
            self._handle(events.WorkerConnected, robot=spec.robot, incarnation=INCARNATION)
        self._update_robots()

    def _put_beliefs(self) -> None:
        for thing, place in self.mission.believed_places().items():
            self._put_fact(Fact(subject=thing, relation=AT, value=place, source="person"))
        for thing, surface in self.mission.believed_supports().items():
            below = self.backend.things.get(surface)
            inside = below is not None and not below.is_a(Feature.SUPPORTS)
            relation = AT if inside else ON
            self._put_fact(Fact(subject=thing, relation=relation, value=surface, source="person"))
        for fact in self.mission.believed_states():
            self._put_fact(fact)
        for number, text in enumerate(self.mission.entry.statements, 1):
            self._handle(
                events.StatementPut, statement=Statement(statement=f"statement_{number}", text=text)
            )

    def _receive(self, facts: tuple[Fact, ...], report: Report | None) -> None:
        for fact in facts:
            self._put_fact(fact)
        if report is None:
            return
        if report.state is ReportState.STARTED:
            self.counts.tasks += 1
        elif report.state in FINAL_REPORTS and report.state is not ReportState.SUCCEEDED:
            self.counts.failed_tasks += 1
            self.counts.reasons.append(f"{report.task} {report.state.value}: {report.reason}")
        self._handle(events.ReportReceived, report=report)
        if self._done() and not self._ended.done():
            self._ended.set_result(None)

    def _put_fact(self, fact: Fact) -> None:
        self._world.apply(Change(FACT, FactAddress.of(fact.key), fact, ""))
        self._handle(events.FactPut, fact=fact)

    def _done(self) -> bool:
        """Whether nothing more will happen by itself."""
        entries = self.state.plans.values()
        return all(entry.ended or entry.state in ENDED_PLANS for entry in entries) and not any(
            entry.outstanding() for entry in entries
        )

    def _handle(self, kind: type[Event], **fields: Any) -> None:
        """One event into the core; what it causes follows, until there is nothing left to do."""
        self._pending.append(kind(**self._at(), **fields))
        if self._busy:
            return
        self._busy = True
        while self._pending:
            before = self.state
            self.state, effects = step(before, self._pending.popleft())
            # All of a step's effects hold together: what ends makes room for what begins.
            for effect in sorted(effects, key=lambda e: not isinstance(e, Retract)):
                self._carry_out(effect)
        self._busy = False

    def _at(self) -> dict[str, float]:
        return {"time_s": self.backend.time_s, "wall_time_s": self.backend.time_s}

    def _carry_out(self, effect: Effect) -> None:
        if isinstance(effect, MakePlan):
            self._plan(effect)
        elif isinstance(effect, Interpret):
            self._interpret(effect)
        elif isinstance(effect, Retract) and effect.key is ORDER:
            address: Any = effect.address
            self._robots[address.robot].withdraw(address.plan, address.task)
        elif isinstance(effect, Publish) and effect.key is ORDER:
            payload: Any = effect.payload
            self._robots[payload.robot].order(payload)
        elif isinstance(effect, Publish) and isinstance(effect.payload, GoalStatus):
            self.goals[effect.payload.goal] = effect.payload
        elif isinstance(effect, Publish) and isinstance(effect.payload, PlanStatus):
            self._plans[effect.payload.plan] = effect.payload
        elif isinstance(effect, Publish) and isinstance(effect.payload, Answer):
            self._answers[effect.payload.request] = effect.payload
        elif isinstance(effect, Publish) and effect.key is FACT:
            self._world.apply(Change(FACT, effect.address, effect.payload, ""))

    def _plan(self, effect: MakePlan) -> None:
        """The simulated clock stands still meanwhile: what planning takes is counted by itself."""
        if self.counts.revisions >= MOST_REVISIONS:
            self._fail(TimeoutError(f"not done after {MOST_REVISIONS} revisions"))
            return
        began_s = time.process_time()
        made = run_planning_job(effect.given, self._composition)
        self.counts.planning_s += time.process_time() - began_s
        self.counts.revisions += 1
        if isinstance(made, events.PlanningSucceeded):
            making = made.plan.making
            self.counts.rounds += making.rounds
            self.counts.tokens += making.tokens_in + making.tokens_out
            self.counts.fallbacks += making.fallback is not None
        else:
            self.counts.reasons.append(made.reason)
        self._pending.append(made)

    def _interpret(self, effect: Interpret) -> None:
        began_s = time.process_time()
        said = run_interpretation(effect.given, self._composition)
        self.counts.planning_s += time.process_time() - began_s
        self._pending.append(replace(said, **self._at()))
