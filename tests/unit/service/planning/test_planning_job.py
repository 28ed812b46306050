"""How often a planning job has plans checked: a plan's check travels with it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

import pytest

from fleet.core.checker.well_formedness import PlanForm
from fleet.core.model.world import WorldModel
from fleet.planners.symbolic.action_sequences import ALTERNATIVES
from keyexpr_schema.payloads.plans import Plan
from tests.support.fleet_model import FleetModel
from tests.support.household import bring, carrier, manipulator


def test_every_candidate_is_checked_once_and_the_best_once_more_and_once_allocated(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    checks: Counter[str] = Counter()
    read = PlanForm.__init__

    def counted(
        form: PlanForm, plan: Plan, world: WorldModel, allocation: Mapping[str, str] | None
    ) -> None:
        checks["with actors" if allocation is None else "with robots"] += 1
        read(form, plan, world, allocation)

    monkeypatch.setattr(PlanForm, "__init__", counted)
    model = FleetModel((manipulator(), carrier()), cups=2)
    model.plan(bring(1, "hallway"), bring(2, "living_room"))
    assert model.state.plans, model.state
    # The symbolic planner compares every pair of action sequences for two goals; then it tries the
    # order of its choice, and the allocator that of its own.
    assert checks == {"with actors": ALTERNATIVES**2, "with robots": 2}
