"""Laws of schedules: times come in order and none twice, whatever clocks do; and each that is owed
gets just one run, whatever becomes of the planner in between."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from functools import partial
from itertools import pairwise
from zoneinfo import ZoneInfo

from hypothesis import example, given, settings
from hypothesis import strategies as st

from fleet.core import events
from fleet.core.dispatch.standing.runs import LATE_S
from fleet.core.model.recurrence import Recurrence
from fleet.core.model.time_zones import apart_s, moved, time_zone
from fleet.service.time_zones import offsets_of
from keyexpr_schema.payloads.goals import Goal
from keyexpr_schema.payloads.history import GoalRecord
from keyexpr_schema.payloads.schedules import Missed, Schedule
from tests.support.fleet_model import FleetModel
from tests.support.household import at
from tests.support.reached import reaches

NOW = datetime(2026, 11, 29, tzinfo=UTC)
ZONES = (
    *("Europe/Berlin", "America/New_York", "Australia/Lord_Howe", "Africa/Cairo"),
    *("Africa/Casablanca", "Asia/Kolkata", "UTC"),
)
RULES = {name: offsets_of(name, NOW) for name in ZONES}
SPRING_S = datetime(2026, 3, 29, 1, tzinfo=UTC).timestamp()
"""When clocks in Berlin are put forward."""
zones = st.sampled_from(ZONES)
moments = st.integers(
    int(datetime(2021, 1, 1, tzinfo=UTC).timestamp()),
    int(datetime(2035, 1, 1, tzinfo=UTC).timestamp()),
).map(float)


@st.composite
def around_changes(draw: st.DrawFn) -> tuple[str, float]:
    """A zone, and a moment about a day before one at which its clocks are changed."""
    name = draw(zones)
    changes = [at_s for at_s, _ in RULES[name][1:]] or [NOW.timestamp()]
    return name, draw(st.sampled_from(changes)) + draw(st.integers(-90_000, 7200))


times_of_day = st.builds(
    "{} {} * * *".format,
    st.lists(st.integers(0, 59), min_size=1, max_size=2, unique=True).map(
        lambda minutes: ",".join(map(str, minutes))
    ),
    st.lists(st.integers(0, 4), min_size=1, max_size=3, unique=True).map(
        lambda hours: ",".join(map(str, hours))
    ),
)
recurrences = times_of_day | st.sampled_from(
    ("*/15 * * * *", "0 * * * *", "30 */2 * * *", "0 0 1 * *", "P1D", "P2D", "PT1H", "PT90M")
)


@settings(max_examples=80)
@given(around_changes(), moments)
def test_a_zone_by_its_offsets_shows_what_the_zone_shows(
    place: tuple[str, float], other_s: float
) -> None:
    name, at_s = place
    own, real = time_zone(name, RULES[name]), ZoneInfo(name)
    for moment in (at_s, other_s):
        utc = datetime.fromtimestamp(moment, UTC)
        shown, expected = utc.astimezone(own), utc.astimezone(real)
        assert shown.replace(tzinfo=None) == expected.replace(tzinfo=None)
        assert shown.fold == expected.fold
        assert shown.astimezone(UTC) == utc
        for fold in (0, 1):
            wall = expected.replace(tzinfo=None, fold=fold)
            assert wall.replace(tzinfo=own).utcoffset() == wall.replace(tzinfo=real).utcoffset()


@reaches("clocks are changed on the way", "a time that clocks skip")
@settings(max_examples=150)
@example(place=("Europe/Berlin", SPRING_S - 7200.0), every="30 2 * * *", fraction=0.0)
@given(place=around_changes(), every=recurrences, fraction=st.floats(0.0, 0.999))
def test_times_come_in_order_and_none_twice(
    place: tuple[str, float], every: str, fraction: float, reached: dict[str, int]
) -> None:
    name, said_s = place
    zone = time_zone(name, RULES[name])
    shown = datetime.fromtimestamp(said_s + fraction, UTC).astimezone(zone)
    times = Recurrence.of(every, 1000.0, shown)
    found = []
    for at_s in times.after(0.0):
        found.append(at_s)
        if len(found) == 12 or at_s > 1000.0 + 4 * 86_400.0:
            break
    assert all(later > earlier for earlier, later in pairwise(found))
    # Whoever asks from somewhere in between gets the same ones.
    for earlier, later in pairwise(found):
        assert times.next_after(earlier) == later
        assert times.next_after((earlier + later) / 2) == later
    clocks = [shown, *(moved(shown, at_s - 1000.0) for at_s in found)]
    reached["clocks are changed on the way"] += clocks[0].utcoffset() != clocks[-1].utcoffset()
    if "*" in every[:4] or every.startswith("PT") or every == "0 0 1 * *":
        return
    days = [clock.date() for clock in clocks[1:]]
    if every.startswith("P"):
        for earlier, later in pairwise(clocks[1:]):
            assert later.date() - earlier.date() == timedelta(days=int(every[1]))
        return
    minutes, hours = ({int(n) for n in field.split(",")} for field in every.split()[:2])
    for clock in clocks[1:]:
        if (clock.minute in minutes) and (clock.hour in hours):
            assert clock.fold == 0, "the second of two equal times"
            continue
        before = clock - timedelta(minutes=1)  # on the clock: a minute that it does not show
        assert apart_s(clock, before) != 60.0, "no time of the line, and none after skipped ones"
        reached["a time that clocks skip"] += 1
    assert max(days.count(day) for day in set(days)) <= len(minutes) * len(hours)


HOUR_S = 3600.0


@reaches("made up for", "killed with times to make up for")
@settings(max_examples=12)
@given(
    missed=st.sampled_from(list(Missed)),
    steps=st.lists(
        st.tuples(st.sampled_from((5.0, 600.0, HOUR_S, 9000.0)), st.booleans()),
        min_size=2,
        max_size=5,
    ),
)
def test_each_run_that_is_owed_is_begun_once(
    missed: Missed, steps: list[tuple[float, bool]], reached: dict[str, int]
) -> None:
    model = FleetModel((), cups=2)
    start_s = model.time_s + 1.0
    goal = Goal(
        goal="s",
        text="Bring cup 1 to the hallway",
        every="PT1H",
        said_s=start_s,
        only_if=(at("cup_2", "hallway"),),  # it is not, so that each run is over at once
    )
    model.receive(events.SchedulePut, schedule=Schedule(schedule="s", goal=goal, missed=missed))
    owed, known = 1, 1
    for wait_s, killed in steps:
        model.time_s += wait_s
        for happens in (
            *([model.crash] if killed else []),
            partial(model.receive, events.TimerFired),
        ):
            happens()
            passed_s = model.state.time_s - start_s
            total = int(passed_s // HOUR_S) + 1
            if (new := total - known) == 0:
                continue
            in_time = passed_s % HOUR_S <= LATE_S
            owed += {Missed.ALL: new, Missed.ONCE: 1, Missed.SKIP: int(in_time)}[missed]
            known = total
            reached["made up for"] += not in_time
            reached["killed with times to make up for"] += killed
    # What is over in the event before a crash is archived again after it: the same, once more.
    over = [record for record in model.past if isinstance(record, GoalRecord)]
    runs = [name for name, _ in dict.fromkeys((r.spec.goal, r.ended_wall_s) for r in over)]
    assert runs == [f"s.{number}" for number in range(1, owed + 1)]
    assert model.state.goal_states["s"].runs == owed
    assert model.state.goal_states["s"].missed == known - owed
