"""A fleet with small batteries, for tests of the planner's own charging: tasks take their time, and
take what they draw out of batteries that run down whatever a robot does. No clock, no process.
"""

from __future__ import annotations

from dataclasses import replace
from random import Random
from typing import Any

import msgspec

from fleet.core import events
from fleet.core.events import Event
from keyexpr_schema.facts import AT
from keyexpr_schema.payloads.goals import ENDED_GOALS, Goal
from keyexpr_schema.payloads.robots import FULL, Battery, RobotSpec, charge_step
from keyexpr_schema.payloads.tasks import Order
from keyexpr_schema.payloads.world import Object
from tests.support.fleet_model import FleetModel
from tests.support.household import bring, carrier, manipulator

SMALL = Battery(capacity_wh=3.0, idle_w=6.0, driving_w=60.0, working_w=45.0, charging_w=240.0)
CHARGER = Object(object="charger", kind="charger", label="charger", movable=False, home="hallway")
SECOND = msgspec.structs.replace(CHARGER, object="charger_2", home="living_room")
MOST_EVENTS = 4000


def powered(spec: RobotSpec, battery: Battery = SMALL) -> RobotSpec:
    """The robot with a battery, and with what it takes to charge it."""
    return msgspec.structs.replace(spec, battery=battery, skills=(*spec.skills, "charge"))


def team() -> tuple[RobotSpec, ...]:
    """Two that have a hand, and one with a basket."""
    return powered(manipulator()), powered(manipulator("hsr_2")), powered(carrier())


class BatteryFleet(FleetModel):
    """Orders are carried out by simulated time; `least` is the lowest charge there ever was [%]."""

    def __init__(
        self,
        robots: tuple[RobotSpec, ...] | None = None,
        *,
        cups: int = 4,
        seed: int = 0,
        charge: tuple[float, ...] = (),
        late: bool = False,
        chargers: tuple[Object, ...] = (CHARGER,),
    ) -> None:
        self.chance = Random(seed)
        self.percent: dict[str, float] = {}
        self.least = FULL
        self.charged: list[str] = []
        """Who was charged, in turn."""
        self.waited = self.charged_loaded = 0
        """How often somebody stood before a charger that was taken, or had a full hand there."""
        self.at_charger: list[int] = []
        """How many robots were at a charger, each time that somebody came."""
        self.charged_at: dict[str, list[str]] = {}
        """Who was charged by each charger, in turn."""
        self._batteries: dict[str, Battery] = {}
        self._busy: dict[str, tuple[float, Order, float]] = {}
        """By robot, when its task ends, which that is, and what it draws on average [W]."""
        self._passed_s = 0.0
        robots = team() if robots is None else robots
        super().__init__(robots, cups, late=late)
        for charger in chargers:
            self.receive(events.ObjectPut, object=charger)
        levels = dict(zip((spec.robot for spec in robots), charge, strict=False))
        for spec in robots:
            assert spec.battery is not None
            self._batteries[spec.robot] = spec.battery
            self.percent[spec.robot] = levels.get(spec.robot, FULL)
            self.learn(spec.robot, AT, "kitchen")
        self._passed_s = self.time_s
        self._tell()

    def receive(self, kind: type[Event], **fields: Any) -> None:
        """As that of all fleet models, in less time: robots do not stand about for each event."""
        self.time_s -= 0.9
        super().receive(kind, **fields)

    def _tell(self) -> None:
        for robot, percent in self.percent.items():
            if self._truth.get(("charge", robot)) != charge_step(percent):
                self.learn(robot, "charge", charge_step(percent))

    def _pass(self) -> None:
        """What is drawn since the last time."""
        hours = (self.time_s - self._passed_s) / 3600.0
        self._passed_s = self.time_s
        for robot, battery in self._batteries.items():
            power = -self._busy[robot][2] if robot in self._busy else -battery.idle_w
            change = battery.percent(power * hours)
            self.percent[robot] = min(max(self.percent[robot] + change, 0.0), FULL)
            self.least = min(self.least, self.percent[robot])

    def _begin(self, order: Order) -> None:
        # What tasks really take does not depend on what the planner has learned of it.
        robot, world = order.robot, replace(self.state.world(), durations={})
        battery, action = self._batteries[robot], self._skills[order.skill].ground(order.args)
        takes_s = world.duration_s(action, world.value(AT, robot), robot)
        takes_s *= self.chance.uniform(0.8, 1.25)
        power = battery.driving_w if order.skill == "navigate" else battery.working_w
        if action.skill.recharges:
            charger = order.args["charger"]
            at = (o.args.get("charger") for _, o, _ in self._busy.values())
            there = [name for name in at if name == charger]
            self.charged_at.setdefault(charger, []).append(robot)
            self.at_charger.append(1 + len(there))
            self.charged.append(robot)
            self.charged_loaded += world.value("holding", robot) not in ("nothing", None)
            takes_s, power = battery.charging_s(self.percent[robot]), -battery.charging_w
        self._busy[robot] = (self.time_s + takes_s, order, power)
        self.start(order)

    def _waiting(self) -> int:
        """How many robots are ready to charge and have to wait."""
        at = [o.robot for _, o, _ in self._busy.values() if o.skill == "charge"]
        return sum(
            entry.records[task].skill == "charge" and bool(at) and robot not in self._busy
            for entry in self.state.plans.values()
            for robot, tasks in entry.index.ready.items()
            for task in tasks
        )

    def carry_on(self) -> None:
        """Until nobody has anything to do."""
        for _ in range(MOST_EVENTS):
            self.waited += self._waiting()
            for order in self.wanted():
                if order.robot not in self._busy:
                    self._begin(order)
            for order in self.orders():
                if order.cancelled:
                    done = self._busy.get(order.robot)
                    if done is not None and _name(done[1]) == _name(order):
                        self._pass()
                        del self._busy[order.robot]
                    self.cancelled(order)
            if self.answers:
                self.answer(self.chance.randrange(len(self.answers)))
                continue
            if not self._busy:
                return
            robot = min(self._busy, key=lambda name: self._busy[name][0])
            self.time_s = max(self.time_s, self._busy[robot][0])
            self._pass()
            _, order, power = self._busy.pop(robot)
            if self.percent[robot] <= 0.0:
                self._tell()
                self.fail(order, f"the battery of {robot} is empty")
                continue
            if power < 0.0:
                self._truth["charge", robot] = charge_step(self.percent[robot])
            self._tell()
            self.succeed(order)
        raise AssertionError("it never comes to rest")

    def wait(self, seconds: float) -> None:
        """Robots stand about."""
        for _ in range(10):
            self.time_s += seconds / 10
            self._pass()
            self._tell()
            self.carry_on()

    def errands(self, number: int) -> list[Goal]:
        """Cups to be brought somewhere, in goals that there has not been one of. None that lies in
        a basket: these robots do not take things out of one."""
        cups = [n for n in range(1, 5) if self._truth["at", f"cup_{n}"] in self.state.places]
        goals: list[Goal] = []
        for cup in self.chance.sample(cups, min(number, len(cups))):
            place = self.chance.choice(["kitchen", "hallway", "living_room"])
            name = f"goal_{len(self.journal)}_{len(goals)}"
            goals.append(msgspec.structs.replace(bring(cup, place), goal=name))
        return goals

    def open_goals(self) -> list[str]:
        """Goals that have not ended, with why."""
        return [
            f"{goal}: {status.state.value}: {status.reason}"
            for goal, status in self.goal_states.items()
            if status.state not in ENDED_GOALS
        ]


def _name(order: Order) -> tuple[str, str, int]:
    return order.plan, order.task, order.attempt
