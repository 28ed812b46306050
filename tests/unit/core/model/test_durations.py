"""What reports teach of durations, and what the next plan makes of it."""

from __future__ import annotations

from statistics import mean

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.core import events
from fleet.core.model.durations import FASTEST, FULL_ATTEMPTS, SLOWEST, learn, pace, work_s
from fleet.core.state import State
from fleet.core.step import step
from keyexpr_schema.keyspace import DURATIONS
from keyexpr_schema.payloads.durations import Durations, Estimate
from keyexpr_schema.payloads.tasks import ReportState
from tests.support.fleet_model import FleetModel
from tests.support.household import SKILLS, bring, manipulator

PICK, NAVIGATE = SKILLS["pick"], SKILLS["navigate"]


def taught(*attempts: tuple[str, float, float]) -> Durations:
    """What `(skill, took [s], way [s])` teach of the model hsr."""
    known: dict[str, Durations] = {}
    for skill, took_s, way_s in attempts:
        known = dict(learn(known, "hsr", SKILLS[skill], took_s, way_s, 0.0))
    return known["hsr"]


def test_the_first_attempt_counts_as_much_as_the_skill_model() -> None:
    known = taught(("pick", 47.0, 0.0))
    assert work_s(known, PICK) == pytest.approx((27.0 + 47.0) / 2)
    assert known.skills["pick"].count == 1
    assert work_s(known, SKILLS["place"]) == SKILLS["place"].duration_s
    assert pace(known) == 1.0


def test_what_is_always_the_same_is_soon_known() -> None:
    known = taught(*[("pick", 47.0, 0.0)] * 30)
    assert work_s(known, PICK) == pytest.approx(47.0, abs=1.0)
    assert known.skills["pick"].sd < 4.0


def test_a_change_is_followed() -> None:
    known = taught(*[("pick", 20.0, 0.0)] * 100, *[("pick", 60.0, 0.0)] * 60)
    assert work_s(known, PICK) == pytest.approx(60.0, abs=2.5)


def test_drives_teach_the_pace_and_what_a_drive_takes_besides() -> None:
    known = taught(*[("navigate", 2.0 * (4.0 + way), way) for way in (5.0, 10.0, 20.0) * 12])
    assert pace(known) == pytest.approx(2.0, rel=0.1)
    assert work_s(known, NAVIGATE) == pytest.approx(8.0, rel=0.1)


def test_a_drive_to_where_the_robot_is_teaches_nothing() -> None:
    assert learn({}, "hsr", NAVIGATE, 0.0, 0.0, 0.0) == {}


@given(
    st.lists(
        st.tuples(
            st.sampled_from(["pick", "navigate", "search"]),
            st.floats(0.0, 1e4),
            st.floats(0.0, 100.0),
        ),
        min_size=1,
        max_size=60,
    )
)
def test_estimates_stay_between_what_was_assumed_and_observed(
    attempts: list[tuple[str, float, float]],
) -> None:
    known: dict[str, Durations] = {}
    for skill, took_s, way_s in attempts:
        known = dict(learn(known, "hsr", SKILLS[skill], took_s, way_s, 0.0))
    for durations in known.values():
        assert FASTEST <= pace(durations) <= SLOWEST
        for name, each in durations.skills.items():
            longest = max(took for skill, took, _ in attempts if skill == name)
            assert 0.0 <= each.mean <= max(longest, SKILLS[name].duration_s) + 1e-6
            assert each.sd >= 0.0
            assert each.weight <= FULL_ATTEMPTS


@given(st.lists(st.floats(1.0, 100.0), min_size=1, max_size=15))
def test_until_it_forgets_it_is_the_plain_mean(tooks_s: list[float]) -> None:
    known = taught(*[("pick", took_s, 0.0) for took_s in tooks_s])
    assert work_s(known, PICK) == pytest.approx(mean([27.0, *tooks_s]))


# --- in the planner ----------------------------------------------------------------------------


def test_reports_teach_and_the_next_plan_counts_with_it() -> None:
    model = FleetModel((manipulator(),), cups=2)
    model.plan(bring(1, "hallway"))
    while model.orders():
        (order,) = model.orders()
        model.start(order)
        model.time_s += 99.0
        model.succeed(order)
    known = model.state.durations["hsr"]
    assert known.skills["pick"].mean == pytest.approx((27.0 + 100.0) / 2)
    assert model.documents["durations/hsr"] == known
    world = model.state.world()
    pick = PICK.ground({"robot": "hsr", "object": "cup_2", "place": "kitchen"})
    assert world.duration_s(pick, "kitchen", "hsr") == known.skills["pick"].mean
    model.plan(bring(2, "hallway"))
    predicted = {r.skill: r.duration_s for r in model.plans["plan-2"].current()}
    assert predicted["pick"] == known.skills["pick"].mean
    assert predicted["navigate"] > 4.0 + 4.0 / 0.6


def test_what_failed_or_was_interrupted_teaches_nothing() -> None:
    model = FleetModel((manipulator(),), cups=1)
    model.plan(bring(1, "hallway"))
    model.interrupt(model.orders()[0], done=True)
    model.fail(model.orders()[0])
    assert model.state.durations == {}


def test_a_planner_that_lost_its_journal_still_knows() -> None:
    known = Durations(model="hsr", skills={"pick": Estimate(mean=50.0, count=7, weight=8.0)})
    remembered = events.PriorStateLoaded(time_s=0.0, wall_time_s=0.0, durations=(known,))
    state, effects = step(State(), remembered)
    assert state.durations == {"hsr": known}
    assert [getattr(effect, "key", None) for effect in effects] == [DURATIONS]


def test_a_try_that_failed_within_a_success_counts_with_it() -> None:
    model = FleetModel((manipulator(),), cups=1)
    model.plan(bring(1, "hallway"))
    model.succeed(model.orders()[0])
    (pick,) = model.orders()
    model.start(pick)
    begun_s = model.time_s
    model.time_s += 80.0
    model.report(
        pick,
        ReportState.SUCCEEDED,
        started_s=begun_s,
        ended_s=begun_s + 80.0,
        facts=model.facts_after(pick),
    )
    assert model.state.durations["hsr"].skills["pick"].mean == pytest.approx((27.0 + 80.0) / 2)
