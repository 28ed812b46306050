"""A soak of random errands with small batteries: three robots, one charger or two.

    python -m tests.support.battery_soak [--runs 200] [--chargers 2]

Planner's core, planning and allocation are real, robots and their batteries a model of discrete
events. Ends with 1 if a goal was not reached, a battery ran empty, or two robots were at a charger
at once.
"""

from __future__ import annotations

import argparse
import random
import sys
from collections import Counter

from keyexpr_schema.payloads.goals import GoalState
from tests.support.battery_fleet import CHARGER, SECOND, BatteryFleet

BATCHES, ERRANDS = 6, 3


def main() -> int:
    """Run, and print what came of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--chargers", type=int, choices=(1, 2), default=1)
    given = parser.parse_args()
    runs, chargers = given.runs, (CHARGER, SECOND)[: given.chargers]
    found, least = Counter[str](), 100.0
    for seed in range(runs):
        chance = random.Random(seed)
        charge = tuple(chance.uniform(25.0, 100.0) for _ in range(3))
        late = chance.random() < 0.5
        fleet = BatteryFleet(seed=seed, charge=charge, late=late, chargers=chargers)
        asked = []
        for _ in range(BATCHES):
            goals = fleet.errands(ERRANDS)
            asked += goals
            fleet.plan(*goals)
            fleet.carry_on()
            fleet.wait(120.0)
        found["goals"] += len(asked)
        found["reached"] += sum(
            fleet.goal_states[goal.goal].state is GoalState.REACHED for goal in asked
        )
        found["charged"] += len(fleet.charged)
        found.update({name: len(who) for name, who in fleet.charged_at.items()})
        found["two at once"] += max(fleet.at_charger, default=0) > 1
        found["ran empty"] += fleet.least <= 0.0
        least = min(least, fleet.least)
    print(f"{runs} runs: {found['reached']} of {found['goals']} goals reached")
    at = ", ".join(f"{found[each.object]} at {each.object}" for each in chargers)
    print(f"charged {found['charged']} times ({at}), the lowest charge ever was {least:.1f} %")
    print(f"ran empty {found['ran empty']}, two at one charger {found['two at once']}")
    wrong = found["goals"] - found["reached"] + found["two at once"] + found["ran empty"]
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
