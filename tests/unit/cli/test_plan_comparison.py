"""Two plans held against each other."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from cli.plans.comparison import PlanSide, compare
from keyexpr_schema.ids import actor_arg
from keyexpr_schema.payloads.plans import Plan, Task


def task(name: str, skill: str = "navigate", actor: str = "a1", *after: str, **args: str) -> Task:
    return Task(
        task=name, skill=skill, actor=actor, after=after, args={"robot": actor_arg(actor), **args}
    )


FETCH = (
    task("t1", to="kitchen"),
    task("t2", "pick", "a1", "t1", object="cup_1", place="kitchen"),
    task("t3", "place_on_robot", "a1", "t2", object="cup_1", carrier="?a2", place="kitchen"),
    task("t4", "navigate", "a2", "t3", to="hallway"),
)
ROBOTS = {"a1": "hsr", "a2": "locobot"}


def side(*tasks: Task, name: str = "p", goals: tuple[str, ...] = ("g",), **robots: str) -> PlanSide:
    plan = Plan(plan="p", goals=goals, conditions=(), tasks=tasks)
    return PlanSide(name=name, plan=plan, allocation=robots)


def test_a_plan_is_the_same_as_itself() -> None:
    found = compare(side(*FETCH, **ROBOTS), side(*FETCH, **ROBOTS))
    assert [each.task for each in found.kept] == ["t1", "t2", "t3", "t4"]
    assert not (found.changed or found.dropped or found.added or found.finished)


def test_every_field_of_a_task_is_compared() -> None:
    other = (
        task("t1", to="pantry"),
        replace(FETCH[1], skill="grab"),
        replace(FETCH[2], actor="a9", args={**FETCH[2].args, "robot": "?a9"}),
        replace(FETCH[3], after=()),
    )
    now = side(*other, a1="hsr", a2="carrier", a9="tiago")
    changes = {
        each.task: {(c.field, c.before, c.now) for c in each.changes}
        for each in compare(side(*FETCH, **ROBOTS), now).changed
    }
    assert changes == {
        "t1": {("args.to", "kitchen", "pantry")},
        "t2": {("skill", "pick", "grab")},
        "t3": {("args.carrier", "locobot", "carrier"), ("robot", "hsr", "tiago")},
        "t4": {("robot", "locobot", "carrier"), ("after", "t3", "nothing")},
    }


def test_actors_have_no_meaning_outside_their_plan() -> None:
    renamed = tuple(
        replace(
            each,
            actor=each.actor.replace("a", "b"),
            args={name: value.replace("?a", "?b") for name, value in each.args.items()},
        )
        for each in FETCH
    )
    assert len(compare(side(*FETCH), side(*renamed)).kept) == 4
    assert len(compare(side(*FETCH, **ROBOTS), side(*renamed)).kept) == 4


def test_the_same_calls_under_other_names_are_the_same_tasks() -> None:
    shifted = tuple(
        replace(
            each,
            task=each.task.replace("t", "s"),
            after=tuple(before.replace("t", "s") for before in each.after),
        )
        for each in FETCH
    )
    found = compare(side(*FETCH), side(*shifted))
    assert [(each.was, each.task) for each in found.kept] == [
        (f"t{number}", f"s{number}") for number in (1, 2, 3, 4)
    ]


def test_finished_tasks_are_not_missed() -> None:
    rest = (replace(FETCH[1], after=()), *FETCH[2:])
    found = compare(side(*FETCH), side(*rest), finished=["t1"])
    assert [each.task for each in found.finished] == ["t1"]
    assert len(found.kept) == 3
    assert [each.task for each in compare(side(*FETCH), side(*rest)).dropped] == ["t1"]


def test_goals_are_compared() -> None:
    found = compare(side(goals=("g", "h")), side(goals=("g", "i")))
    assert (found.goals_dropped, found.goals_added) == (("h",), ("i",))


CALLS = st.builds(
    lambda skill, place: (skill, place),
    st.sampled_from(["navigate", "search"]),
    st.sampled_from(["kitchen", "hallway"]),
)


@given(
    st.dictionaries(st.sampled_from(["t1", "t2", "t3", "t4"]), CALLS),
    st.dictionaries(st.sampled_from(["t1", "t2", "t3", "t4", "t5"]), CALLS),
)
def test_every_task_is_told_once(ours: dict[str, object], theirs: dict[str, object]) -> None:
    def tasks(calls: dict[str, object]) -> tuple[Task, ...]:
        return tuple(
            task(name, skill, to=place)
            for name, (skill, place) in calls.items()  # type: ignore[misc]
        )

    found = compare(side(*tasks(ours)), side(*tasks(theirs)))
    both = [*found.kept, *found.changed]
    assert sorted([*(e.was for e in both), *(t.task for t in found.dropped)]) == sorted(ours)
    assert sorted([*(e.task for e in both), *(t.task for t in found.added)]) == sorted(theirs)
