"""What the planner wants itself is never forgotten: whatever people do meanwhile, in the end every
hand that nobody needs is empty, every robot that was low has charged, and until then each such goal
is in a plan or waits to be planned."""

from __future__ import annotations

from collections import Counter

from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st

from fleet.core import events
from keyexpr_schema.facts import CHARGE, HOLDING, NOTHING
from keyexpr_schema.payloads.closures import Closure
from keyexpr_schema.payloads.goals import ENDED_GOALS, GoalState
from keyexpr_schema.payloads.holds import Hold, HoldKind
from keyexpr_schema.payloads.requests import Control, ControlRequest
from tests.support.battery_fleet import BatteryFleet
from tests.support.household import bring, cup
from tests.support.reached import Reached, reaches

PLACES = ("kitchen", "hallway", "living_room")
ROBOTS = ("hsr", "hsr_2")
CUPS = 3


class Disturbed(BatteryFleet):
    """A fleet with small batteries to which people do things; robots do at once what they do."""

    def apply(self, event: events.Event) -> None:
        super().apply(event)
        for goal, status in self.state.goal_states.items():
            if not status.own:
                continue
            assert status.state is not GoalState.FAILED, f"{goal} was given up: {status.reason}"
            in_plan = goal in self.state.index.plans_of
            self.met["own goal in a plan"] += in_plan
            assert in_plan or goal in self.state.waiting_for_robots, f"{goal} is forgotten"

    def do(self, what: str, pick: int) -> None:
        """One thing that robots or people do."""
        robot, place = ROBOTS[pick % 2], PLACES[pick % 3]
        thing = f"cup_{1 + pick % CUPS}"
        orders, plans = self.orders(), [p for p, e in self.state.plans.items() if not e.ended]
        match what:
            case "work" if wanted := self.wanted():
                order = wanted[pick % len(wanted)]
                if order.skill == "charge":
                    self.percent[order.robot] = 100.0
                self.succeed(order)
            case "answer" if self.answers:
                self.answer(pick)
            case "confirm":
                for order in [order for order in orders if order.cancelled][:1]:
                    self.cancelled(order)
            case "fail" if orders:
                self.fail(orders[pick % len(orders)])
            case "delete" if goals := self.goals_to_delete():
                self.receive(events.GoalDeleted, goal=goals[pick % len(goals)])
            case "want" if not self.state.index.goals_about.get(thing):
                goal = bring(1 + pick % CUPS, place)
                name = f"g{len(self.journal)}"
                self.plan(goal.__class__(goal=name, text=goal.text, conditions=goal.conditions))
            case "cancel" if plans:
                self.control(Control.CANCEL, plans[pick % len(plans)])
            case "discard" if plans:
                self.control(Control.DELETE, plans[pick % len(plans)])
            case "pause" if plans:
                hold = Hold(hold="wait", kind=HoldKind.PAUSE, plans=(plans[pick % len(plans)],))
                self.receive(events.HoldPut, hold=hold)
            case "drain":
                hold = Hold(hold=f"out-{robot}", kind=HoldKind.DRAIN, robots=(robot,))
                self.receive(events.HoldPut, hold=hold)
            case "return":
                self.receive(events.HoldDeleted, hold=f"out-{robot}")
            case "low":
                self.percent[robot] = 15.0
                self.learn(robot, CHARGE, 15)
            case "close":
                self.receive(events.ClosurePut, closure=Closure(closure="c", names=(place,)))
            case "open":
                self.receive(events.ClosureDeleted, closure="c")
            case "lose":
                self.receive(events.ObjectDeleted, object=thing)
            case "find":
                self.receive(events.ObjectPut, object=cup(1 + pick % CUPS))
            case "leave":
                self.lose(robot)
            case "come":
                self.return_(robot)

    def goals_to_delete(self) -> list[str]:
        """Rather one whose thing is in a hand."""
        state = self.state
        held = [str(fact.value) for r in ROBOTS if (fact := state.fact(HOLDING, r)) is not None]
        about = sorted({goal for thing in held for goal in state.index.goals_about.get(thing, ())})
        put = [goal for goal in about or sorted(state.goals) if goal.startswith("g")]
        return put or [goal for goal in sorted(state.goals) if goal.startswith("g")]

    def control(self, control: Control, plan: str) -> None:
        """Somebody asks something of a plan."""
        name = f"q{len(self.journal)}"
        request = ControlRequest(request=name, control=control, plan=plan)
        self.receive(events.ControlRequested, request=request)

    def end(self) -> None:
        """Nothing is held any more, everything is known, and everybody is there."""
        for robot in ROBOTS:
            self.receive(events.HoldDeleted, hold=f"out-{robot}")
            self.return_(robot)
        self.receive(events.HoldDeleted, hold="wait")
        self.receive(events.ClosureDeleted, closure="c")
        for number in range(1, CUPS + 1):
            if f"cup_{number}" not in self.state.objects:
                self.receive(events.ObjectPut, object=cup(number))
        for _ in range(20):  # what was cancelled leaves something to do
            self.carry_on()
            for robot in [robot for robot, percent in self.percent.items() if percent <= 0.0]:
                self.percent[robot] = 100.0
                self.learn(robot, CHARGE, 100)
            if not self.orders() and not self.answers:
                return
        raise AssertionError("it never comes to rest")

    def stranded(self) -> list[str]:
        """Own goals that are left, and what is in a hand for nobody."""
        found = [g for g, s in self.state.goal_states.items() if s.own]
        for robot in ROBOTS:
            fact = self.state.fact(HOLDING, robot)
            if fact is None or fact.value == NOTHING:
                continue
            about = self.state.index.goals_about.get(str(fact.value), ())
            states = {self.state.goal_states[goal].state for goal in about}
            if not states - ENDED_GOALS:
                found.append(f"{robot} has {fact.value} in its hand")
        return found


STEPS = st.lists(
    st.tuples(
        st.sampled_from(
            ["work"] * 8
            + ["answer", "answer", "confirm", "fail", "delete", "delete", "delete", "want",
               "cancel", "discard", "pause", "drain", "return", "low", "low", "close", "open",
               "lose", "find", "leave", "come"]
        ),
        st.integers(0, 11),
    ),
    min_size=6,
    max_size=30,
)  # fmt: skip


@reaches("own goal in a plan", "put down", "charged")
@settings(max_examples=40, deadline=None, phases=[Phase.explicit, Phase.generate])
@given(st.integers(0, 10**6), st.booleans(), STEPS)
# The plan that the put-down is to go into is cancelled before it is made again.
@example(0, True, [("work", 0), ("work", 0), ("delete", 0), ("cancel", 0), ("confirm", 0)])
# What is to be put down is unknown when that is planned, and known again before the answer.
@example(
    20385,
    True,
    [
        ("answer", 2),
        ("work", 0),
        ("answer", 4),
        ("delete", 10),
        ("work", 7),
        ("work", 0),
        ("lose", 10),
        ("drain", 6),
        ("cancel", 4),
        ("fail", 11),
        ("work", 5),
        ("find", 0),
        ("delete", 10),
        ("cancel", 0),
        ("delete", 7),
        ("discard", 4),
        ("delete", 3),
    ],
)
# A robot that is low delivers what it carries, is drained meanwhile, and comes back.
@example(
    0,
    False,
    [
        ("work", 0),
        ("work", 0),
        ("drain", 0),
        ("drain", 1),
        ("low", 0),
        ("low", 1),
        ("return", 0),
        ("return", 1),
    ],
)
# A robot is charged by hand, so that the plan for its charging ends without a task.
@example(
    1482,
    True,
    [
        ("work", 3),
        ("come", 6),
        ("answer", 8),
        ("low", 5),
        ("answer", 11),
        ("work", 6),
        ("low", 0),
    ],
)
def test_nothing_of_it_is_forgotten(
    reached: Reached, seed: int, late: bool, steps: list[tuple[str, int]]
) -> None:
    fleet = Disturbed(seed=seed, cups=CUPS, late=late)
    fleet.plan(*(bring(n, PLACES[n % 3]) for n in range(1, CUPS + 1)))
    fleet.do("answer", 0)
    for what, pick in steps:
        fleet.do(what, pick)
    fleet.end()
    assert not fleet.stranded(), (fleet.stranded(), fleet.open_goals())
    reached.update(fleet.met)
    ended: Counter[str] = Counter(goal.partition("-")[0] for goal in fleet.goal_states)
    reached["put down"] += ended["put"]
    reached["charged"] += bool(fleet.charged)
