"""Nobody is ever stranded: with small batteries and one charger or two every goal is reached, no
battery runs empty, and one robot at a time is at each, whatever it is that robots are to do."""

from __future__ import annotations

from collections import Counter

from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from keyexpr_schema.payloads.goals import GoalState
from tests.support.battery_fleet import CHARGER, SECOND, BatteryFleet
from tests.support.reached import reaches

BATCHES = 3


def work(fleet: BatteryFleet) -> None:
    """Three times some errands, and robots that stand about between them."""
    asked = []
    for _ in range(BATCHES):
        goals = fleet.errands(3)
        asked += goals
        fleet.plan(*goals)
        fleet.carry_on()
        fleet.wait(120.0)
    for goal in asked:
        status = fleet.goal_states[goal.goal]
        assert status.state is GoalState.REACHED, f"{goal.text}: {status.reason}"
    assert not fleet.open_goals()


@reaches(
    "charged",
    "charged at a second charger",
    "waited for a charger",
    "charged with something in the hand",
)
@given(
    st.integers(0, 10**6),
    st.tuples(*[st.floats(25.0, 100.0)] * 3),
    st.booleans(),
    st.sampled_from((2, 2, 1)),
)
@settings(max_examples=10, deadline=None, phases=[Phase.explicit, Phase.generate])
def test_nobody_is_stranded(
    reached: Counter[str], seed: int, charge: tuple[float, ...], late: bool, chargers: int
) -> None:
    there = (CHARGER, SECOND)[:chargers]
    fleet = BatteryFleet(seed=seed, charge=charge, late=late, chargers=there)
    work(fleet)
    assert fleet.least > 0.0
    assert set(fleet.at_charger) <= {1}
    reached["charged"] += bool(fleet.charged)
    reached["charged at a second charger"] += len(fleet.charged_at.get(SECOND.object, ()))
    reached["waited for a charger"] += fleet.waited
    reached["charged with something in the hand"] += fleet.charged_loaded
