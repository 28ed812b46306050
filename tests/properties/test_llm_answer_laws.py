"""Whatever a model answers: it is refused with reasons, or becomes a plan that holds."""

from __future__ import annotations

import json
from typing import Any

import msgspec
from hypothesis import given
from hypothesis import strategies as st

from fleet.core.checker.plan_checker import CheckedPlan, check_plan
from fleet.llm.quoting import fenced
from fleet.llm.structured_output import read_answer
from fleet.planners.base import PlanningProblem
from fleet.planners.llm.action_elimination import without_redundant_tasks
from fleet.planners.llm.answers import GraphAnswer, ListAnswer, plan_schema
from fleet.planners.llm.candidate import candidate_of, merged, verify
from keyexpr_schema.payloads.plans import Plan
from tests.support.household import bring, home, manipulator
from tests.support.reached import Reached, reaches

WORLD = home((manipulator("r1"), manipulator("r2")))
GOALS = (bring(1, "hallway"), bring(2, "living_room"))
NAMES = st.sampled_from(
    ["?a", "?b", "?", "r1", "cup_1", "cup_2", "kitchen", "hallway", "living_room", "", "../*"]
)
TASKS = st.fixed_dictionaries(
    {
        "task": st.sampled_from(["t1", "t2", "t3", "t4"]),
        "skill": st.sampled_from([*WORLD.skills, "shell"]),
        "args": st.dictionaries(
            st.sampled_from(["robot", "object", "place", "to", "carrier"]), NAMES, max_size=4
        ),
        "after": st.lists(st.sampled_from(["t1", "t2", "t3", "t9"]), max_size=2),
        "goal": st.sampled_from(["g1", "g2", "g9"]),
    }
)
DETOURS = st.fixed_dictionaries(
    {
        "task": st.sampled_from(["t1", "t2", "t3", "t4"]),
        "skill": st.just("navigate"),
        "args": st.fixed_dictionaries({"robot": st.just("?c"), "to": st.just("kitchen")}),
        "after": st.sampled_from([[], ["13"]]),
        "goal": st.just("g1"),
    }
)
"""Tasks that do no harm, and that no goal needs."""
PINS = st.lists(
    st.fixed_dictionaries(
        {"actor": st.just("?a"), "robot": st.sampled_from(["r1", "r2", "nobody"])}
    ),
    max_size=1,
)


def carry(number: int, place: str, actor: str) -> list[dict[str, Any]]:
    where = {"robot": actor, "object": f"cup_{number}"}
    rows = [
        ("navigate", {"robot": actor, "to": "kitchen"}),
        ("pick", {**where, "place": "kitchen"}),
        ("navigate", {"robot": actor, "to": place}),
        ("place", {**where, "place": place}),
    ]
    return [
        {
            "task": f"{number}{n}",
            "skill": skill,
            "args": args,
            "after": [f"{number}{n - 1}"] if n else [],
            "goal": f"g{number}",
        }
        for n, (skill, args) in enumerate(rows)
    ]


def consider(answer: dict[str, Any], flat: bool) -> Plan | set[str]:
    """The plan of an answer, as the planner makes it, or the codes of what is wrong with it."""
    read = read_answer(json.dumps(answer), ListAnswer if flat else GraphAnswer)
    if isinstance(read, str):
        return {"malformed"}
    problem = PlanningProblem("p", GOALS, WORLD)
    plan = candidate_of(read, problem, GOALS, WORLD)
    if violations := verify(plan, WORLD).violations:
        assert all(row.sentence for row in violations)
        return {row.code for row in violations}
    plan = without_redundant_tasks(plan, WORLD)
    made = merged([plan], problem, keep_order=not flat)
    assert isinstance(check_plan(made, WORLD), CheckedPlan)
    # What is stored must be readable again, whatever names the model made up.
    assert msgspec.json.decode(msgspec.json.encode(made), type=Plan) == made
    return made


@reaches("wrong-arguments", "unknown-goal", "goal-unmet")
@given(st.lists(TASKS, max_size=6), PINS, st.booleans())
def test_anything_at_all(
    reached: Reached, tasks: list[dict[str, Any]], pins: list[dict[str, str]], flat: bool
) -> None:
    if flat:
        tasks = [{name: row[name] for name in ("skill", "args", "goal")} for row in tasks]
    made = consider({"tasks": tasks, "pins": pins}, flat)
    reached.update(made if isinstance(made, set) else {"plan"})


@reaches("set", "thinned")
@given(
    st.one_of(st.lists(TASKS, max_size=3), st.lists(DETOURS, min_size=1, max_size=2)),
    st.sampled_from(["?a", "?b"]),
    st.booleans(),
    st.randoms(use_true_random=False),
)
def test_a_good_plan_with_anything_mixed_in(
    reached: Reached, extra: list[dict[str, Any]], second: str, joined: bool, random: Any
) -> None:
    good = [*carry(1, "hallway", "?a"), *carry(2, "living_room", second)]
    if second == "?a" or joined:
        good[4]["after"] = ["13"]
    assert isinstance(consider({"tasks": good}, flat=False), Plan)
    mixed = [*good, *extra]
    random.shuffle(mixed)
    made = consider({"tasks": mixed}, flat=False)
    reached["thinned" if isinstance(made, Plan) and extra else type(made).__name__] += 1
    if isinstance(made, Plan):
        assert sorted(task.skill for task in made.tasks) == sorted(
            ["navigate", "pick", "navigate", "place"] * 2
        ), "nothing that no goal needs"


@given(st.recursive(st.text(), lambda inner: st.dictionaries(st.text(), inner)))
def test_no_text_leaves_its_fence(data: Any) -> None:
    text = fenced(data)
    assert "<" not in text
    assert ">" not in text
    json.loads(text)


@given(st.text())
def test_any_text_is_read(text: str) -> None:
    assert isinstance(read_answer(text, GraphAnswer), str | GraphAnswer)


def test_the_schema_is_narrower_than_the_types() -> None:
    """Every task that the schema allows has just the fields that are read."""
    for flat, kind in ((False, GraphAnswer), (True, ListAnswer)):
        schema = plan_schema(WORLD, GOALS, flat, max_tasks=10)
        assert "$ref" not in json.dumps(schema)
        tasks = schema["properties"]["tasks"]
        assert tasks["maxItems"] == 10
        variants = tasks["items"]["anyOf"]
        taught = {skill for robot in WORLD.team for skill in WORLD.robots[robot].skills}
        names = [
            name
            for name, skill in WORLD.skills.items()
            if name in taught and all(map(WORLD.of_type, skill.types.values()))
        ]
        assert "pick" in names
        assert [v["properties"]["skill"]["enum"] for v in variants] == [[n] for n in names]
        for variant in variants:
            assert variant["additionalProperties"] is False
            example = {name: _example(form) for name, form in variant["properties"].items()}
            read = read_answer(json.dumps({"tasks": [example], "pins": []}), kind)
            assert isinstance(read, kind), read


def _example(form: dict[str, Any]) -> Any:
    if "enum" in form:
        return form["enum"][0]
    if form["type"] == "object":
        return {name: _example(inner) for name, inner in form["properties"].items()}
    if form["type"] == "array":
        return []
    return "?a1" if form["pattern"].startswith(r"^\?") else "t1"
