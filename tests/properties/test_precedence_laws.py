"""What has to hold before something else does so, whoever is how quick: `sometime_before`."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from keyexpr_schema.payloads.goals import Condition, Goal, GoalState, Precedence
from tests.support.fleet_model import FleetModel
from tests.support.household import at, bring, carrier, manipulator
from tests.support.reached import Reached, reaches

PLACES = ("kitchen", "hallway", "living_room")


ABOUT = st.builds(at, st.sampled_from(("cup_1", "cup_2", "cup_3", "r1")), st.sampled_from(PLACES))


@st.composite
def wanted(draw: st.DrawFn) -> tuple[Goal, ...]:
    """Some cups somewhere, and something that has to come first: mostly before one of them is."""
    goals = [
        bring(number, draw(st.sampled_from(PLACES[1:])))
        for number in draw(st.lists(st.integers(1, 3), min_size=1, max_size=3, unique=True))
    ]
    ends = [condition for goal in goals for condition in goal.conditions]
    rows = tuple(
        Precedence(first=draw(ABOUT.filter(lambda c, t=then: c != t)), then=then)
        for then in draw(st.lists(st.sampled_from(ends) | ABOUT, min_size=1, max_size=2))
    )
    return replace(goals[0], sometime_before=rows), *goals[1:]


@reaches(
    least={"reached": 30, "first and then": 10, "never then": 5, "at the same time": 5},
)
@settings(max_examples=100, deadline=None)
@given(wanted(), st.booleans(), st.data())
def test_nothing_holds_too_early(
    reached: Reached, goals: tuple[Goal, ...], helper: bool, data: st.DataObject
) -> None:
    robots = (manipulator("r1"), manipulator("r2"), *((carrier(),) if helper else ()))
    made = FleetModel(robots, cups=3)
    made.learn("r1", "at", "living_room")
    made.learn("r2", "at", "kitchen")
    made.plan(*goals)
    rows = goals[0].sometime_before
    passed = dict.fromkeys(rows, False)
    came = dict.fromkeys(rows, False)

    def holds(condition: Condition) -> bool:
        return made.state.world().holds(condition)

    def look() -> None:
        for row in rows:
            if holds(row.then):
                came[row] = True
                assert passed[row], f"{row} is broken"
        for row in rows:
            passed[row] |= holds(row.first)

    if any(holds(row.then) for row in rows):
        reached["too late"] += 1
        return
    if not made.orders():
        reached["no plan"] += 1  # as where each of two waits for the other
        return
    look()
    for _ in range(200):
        orders = made.orders()
        if not orders:
            break
        reached["at the same time"] += len(orders) > 1
        made.succeed(data.draw(st.sampled_from(orders)))
        look()
        if made.goal_state(goals[0].goal) is GoalState.REACHED:
            break
    assert made.goal_state(goals[0].goal) is GoalState.REACHED
    reached["reached"] += 1
    reached["first and then"] += any(came[row] and passed[row] for row in rows)
    reached["never then"] += not all(came.values())
    assert reached["no plan"] <= max(10, reached["reached"])
