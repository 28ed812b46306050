"""The allocators that look at load or travel, on households, and what they say when it fails."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace as changed
from typing import Any

import pytest

from fleet.allocators.balanced import BalancedAllocator
from fleet.allocators.base import Allocated, AllocationProblem, Allocator, Assignment, NotAllocated
from fleet.allocators.cost_based import CostBasedAllocator
from fleet.allocators.llm import LlmAllocator
from fleet.allocators.load_balancing import Balance, LoadProblem, balance
from fleet.allocators.milp import MilpAllocator
from fleet.allocators.min_max_load import Bound, min_max_load
from fleet.allocators.round_robin import RoundRobinAllocator
from fleet.allocators.solver_run import Found, available_solver, solve
from fleet.core.checker.checked_plan import (
    CheckedPlan,
    InvalidPlan,
    check_allocation,
    check_plan,
)
from fleet.core.model.world import WorldModel
from fleet.core.schedule.actor_constraints import tasks_nobody_can_do
from fleet.llm.client import ModelAnswer, ModelClient
from fleet.llm.configuration import LlmConfig
from fleet.llm.conversation import LanguageModel
from fleet.planners.base import PlanningProblem
from fleet.planners.symbolic.planner import SymbolicPlanner
from fleet.service.composition import compose
from keyexpr_schema.payloads.plans import Plan, Task, Violation
from tests.household import bring, carrier, checked, fact, home, manipulator
from tests.llm_server import LlmServer, Reply

PLAIN = (BalancedAllocator(), MilpAllocator(), CostBasedAllocator(), RoundRobinAllocator())
TEAM = (manipulator("r1"), manipulator("r2"), manipulator("r3"), carrier("c1"), carrier("c2"))


def plan_for(world: WorldModel, goals: int) -> Plan:
    wanted = [bring(n, "hallway" if n % 2 else "living_room") for n in range(1, goals + 1)]
    made = SymbolicPlanner().plan(PlanningProblem("p", tuple(wanted), world))
    assert isinstance(made, CheckedPlan), made
    return made.plan


def loads(plan: Plan, made: Allocated) -> list[int]:
    found = dict.fromkeys(made.allocation.values(), 0)
    for task in plan.tasks:
        found[made.allocation[task.actor]] += 1
    return sorted(found.values(), reverse=True)


def drives(
    *robots: str, to: str = "kitchen", after: dict[int, tuple[str, ...]] | None = None
) -> Plan:
    """A plan of one drive for each; a name pins its actor to that robot, "" leaves it free."""
    tasks = [
        Task(
            task=f"t{n}",
            skill="navigate",
            args={"robot": f"?a{n}", "to": "kitchen"},
            actor=f"a{n}",
            after=(after or {}).get(n, ()),
        )
        for n in range(len(robots))
    ]
    pins = {f"a{n}": robot for n, robot in enumerate(robots) if robot}
    return Plan(plan="p", goals=(), conditions=(), tasks=tuple(tasks), pins=pins)


@pytest.mark.parametrize("allocator", PLAIN, ids=lambda allocator: allocator.name)
def test_every_allocator_passes_the_checker(allocator: Allocator) -> None:
    world = home(TEAM, cups=8)
    plan = plan_for(world, 8)
    made = allocator.allocate(checked(plan, world))
    assert isinstance(made, Allocated), made
    order = made.schedule.extra_after
    assert check_allocation(plan, world, made.allocation, order) == ()
    assert set(made.allocation) == {task.actor for task in plan.tasks}


@pytest.mark.parametrize("allocator", PLAIN, ids=lambda allocator: allocator.name)
def test_pins_and_capabilities_bind_every_allocator(allocator: Allocator) -> None:
    world = home(TEAM)
    made = allocator.allocate(checked(drives("c2", "", "c2"), world))
    assert isinstance(made, Allocated), made
    assert made.allocation["a0"] == made.allocation["a2"] == "c2"


@pytest.mark.parametrize("allocator", PLAIN, ids=lambda allocator: allocator.name)
def test_a_plan_without_tasks_is_allocated(allocator: Allocator) -> None:
    made = allocator.allocate(checked(drives(), home()))
    assert isinstance(made, Allocated)
    assert made.allocation == {}


@pytest.mark.parametrize("allocator", PLAIN, ids=lambda allocator: allocator.name)
def test_too_few_robots_are_said_with_tasks_and_names(allocator: Allocator) -> None:
    """Two cups are to be in two baskets, and there is one: both loads stay at the end."""
    world = home((manipulator(), carrier("c1")), cups=2)
    rows: list[Task] = []
    for n in (1, 2):
        hand, basket = f"?h{n}", f"?b{n}"
        cup = {"robot": hand, "object": f"cup_{n}", "place": "kitchen"}
        rows += [
            task(f"go{n}", "navigate", {"robot": hand, "to": "kitchen"}),
            task(f"come{n}", "navigate", {"robot": basket, "to": "kitchen"}),
            task(f"pick{n}", "pick", cup, f"go{n}"),
            task(f"give{n}", "place_on_robot", {**cup, "carrier": basket}, f"pick{n}", f"come{n}"),
        ]
    plan = Plan(plan="p", goals=(), conditions=(), tasks=tuple(rows))
    refused = allocator.allocate(checked(plan, world))
    assert isinstance(refused, NotAllocated), refused
    told = refused.violations[0].sentence
    assert "actors b1 and b2 must all be different robots" in told
    assert "each still has a load at the end" in told
    assert "only c1 can be any of them" in told


def task(name: str, skill: str, args: dict[str, str], *after: str) -> Task:
    return Task(task=name, skill=skill, args=args, actor=args["robot"][1:], after=after)


def test_the_evenest_loads_are_found_where_round_robin_misses_them() -> None:
    """Free actors come first in turn, and take the one robot that the pinned ones need."""
    world = home((manipulator("r1"), manipulator("r2")))
    plan = drives("", "", "r1", "r1")
    even = BalancedAllocator().allocate(checked(plan, world))
    turn = RoundRobinAllocator().allocate(checked(plan, world))
    assert isinstance(even, Allocated) and isinstance(turn, Allocated)
    assert loads(plan, even) == [2, 2]
    assert loads(plan, turn) == [3, 1]


def test_round_robin_goes_on_where_it_stopped() -> None:
    made = RoundRobinAllocator().allocate(checked(drives(*[""] * 7), home(TEAM)))
    assert isinstance(made, Allocated)
    assert list(made.allocation.values()) == ["c1", "c2", "r1", "r2", "r3", "c1", "c2"]


def test_cost_based_sends_the_robot_that_is_there() -> None:
    world = home(
        TEAM[:3],
        facts=(
            fact("r1", "at", "living_room"),
            fact("r2", "at", "kitchen"),
            fact("r3", "at", "hallway"),
        ),
    )
    # The second drive waits for the first, so it is of the next round: r2 is still the nearest.
    made = CostBasedAllocator().allocate(checked(drives("", "", after={1: ("t0",)}), world))
    assert isinstance(made, Allocated)
    assert made.allocation == {"a0": "r2", "a1": "r2"}
    # In one round every robot takes one at most.
    made = CostBasedAllocator().allocate(checked(drives("", ""), world))
    assert isinstance(made, Allocated)
    assert set(made.allocation.values()) == {"r2", "r3"}


def test_the_milp_breaks_ties_by_travel() -> None:
    world = home(TEAM[:2], facts=(fact("r1", "at", "living_room"), fact("r2", "at", "kitchen")))
    made = MilpAllocator().allocate(checked(drives(""), world))
    assert isinstance(made, Allocated)
    assert made.allocation == {"a0": "r2"}


def test_cost_based_says_so_where_its_rounds_leave_no_robot() -> None:
    """a0 takes the near r1 in the first round, which a1 must be and must not be with a0."""
    world = home(TEAM[:2], facts=(fact("r1", "at", "kitchen"), fact("r2", "at", "hallway")))
    plan = drives("", "r1", after={1: ("t0",)})
    problem = AllocationProblem(
        checked=checked(plan, world),
        able={"a0": ("r1", "r2"), "a1": ("r1",)},
        load={"a0": 1, "a1": 1},
        apart=frozenset({("a0", "a1")}),
    )
    made = CostBasedAllocator()._assign(problem)
    assert isinstance(made, Assignment)
    assert made.allocation == {"a0": "r2", "a1": "r1"}
    assert made.notes[0].startswith("allocated by load and not by travel")
    together = CostBasedAllocator()._assign(changed(problem, apart=frozenset()))
    assert together == {"a0": "r1", "a1": "r1"}


def test_what_is_not_proven_is_noted() -> None:
    """Weights without a pattern, so many that no search gets through."""
    names = tuple(f"r{n}" for n in range(9))
    world = home(tuple(manipulator(name) for name in names))
    plan = drives(*[""] * 33)
    able = {f"a{n}": names for n in range(33)}
    load = {f"a{n}": 61 + n * n % 37 for n in range(33)}
    problem = AllocationProblem(checked(plan, world), able, load, frozenset())
    made = BalancedAllocator()._assign(problem)
    assert isinstance(made, Assignment)
    assert "is not proven" in made.notes[0]


class Undecided(MilpAllocator):
    """The program of a solver that never gets anywhere."""

    def _assign(self, problem: AllocationProblem) -> Assignment | NotAllocated:
        told = Violation(code="no-allocation", sentence="the solver found nothing in time")
        return self._otherwise(problem, NotAllocated((told,)))


def test_the_papers_fallback_is_off_unless_asked_for_and_says_so() -> None:
    plan, world = drives("", ""), home(TEAM[:2])
    refused = Undecided().allocate(checked(plan, world))
    assert isinstance(refused, NotAllocated)
    made = Undecided(fallback_round_robin=True).allocate(checked(plan, world))
    assert isinstance(made, Allocated)
    assert made.allocation == {"a0": "r1", "a1": "r2"}
    (note,) = made.notes
    assert note.endswith("by round-robin and not by the MILP: the solver found nothing in time")
    offered = compose().allocators
    assert type(offered["milp-or-round-robin"]) is type(offered["milp"]) is MilpAllocator


def test_tasks_that_nobody_can_do_are_named_with_what_is_lacking() -> None:
    plan = plan_for(home(), 1)
    world = home((carrier("c1"), manipulator("weak", grip_kg=0.1)))
    invalid = check_plan(plan, world)
    assert isinstance(invalid, InvalidPlan)
    refused = tasks_nobody_can_do(invalid)
    pick = next(row.task for row in plan.tasks if row.skill == "pick")
    assert refused[0].task == pick
    sentence = refused[0].sentence
    assert sentence.startswith(f"no robot can do task {pick}, pick: ")
    assert "c1 does not have the skill pick" in sentence
    assert "weak's grip is 0.1 kg" in sentence


@pytest.mark.parametrize("solver", ["cbc", "highs"])
def test_a_solver_keeps_standard_output_clean_and_says_what_it_found(
    solver: str, capfd: pytest.CaptureFixture[str]
) -> None:
    if solver == "highs" and available_solver() != "highs":
        pytest.skip("highspy is not installed")
    able = {f"a{n}": ("r1", "r2", "r3") for n in range(8)}
    load = dict.fromkeys(able, 1)
    made = min_max_load(able, load, frozenset(), Bound(), 20.0, solver=solver)
    assert (made.top, made.proven) == (3, True)
    pair, apart = {"a": ("r1",), "b": ("r1",)}, frozenset({("a", "b")})
    none = min_max_load(pair, {"a": 1, "b": 1}, apart, Bound(), 20.0, solver=solver)
    assert (none.robot, none.proven) == (None, True)
    assert capfd.readouterr() == ("", "")


def test_a_solver_that_does_not_run_is_no_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    import pulp

    monkeypatch.setattr(pulp.PULP_CBC_CMD, "pulp_cbc_path", "/no/such/solver")
    model = pulp.LpProblem("m", pulp.LpMinimize)
    model += model.add_variable("x", lowBound=1)
    assert solve(model, 5.0, solver="cbc").found is Found.NOTHING


def test_many_robots_that_are_alike_do_not_keep_the_milp_busy() -> None:
    """202 tasks and 20 robots took the solver alone 20 s."""
    able = {f"a{n}": tuple(f"r{r}" for r in range(20)) for n in range(202)}
    made = balance(LoadProblem([(1 << 20) - 1] * 202, [1] * 202, 20))
    assert isinstance(made, Balance)
    robot = {actor: f"r{r}" for actor, r in zip(able, made.robot, strict=True)}
    travel_s = {(a, r): float((n * 7 + m * 3) % 11) for n, a in enumerate(able)
                for m, r in enumerate(able[a])}  # fmt: skip
    bound = Bound(made.least_top, robot)
    solved = min_max_load(able, dict.fromkeys(able, 1), frozenset(), bound, 20.0, travel_s)
    assert (solved.top, solved.proven) == (11, True)
    assert solved.robot is not None
    before = sum(travel_s[pair] for pair in robot.items())
    assert sum(travel_s[pair] for pair in solved.robot.items()) < before


@pytest.fixture(scope="module")
def client() -> Iterator[ModelClient]:
    """One for all tests: LiteLLM takes seconds to import."""
    client = ModelClient()
    yield client
    client.close()


def by_model(server: LlmServer, client: ModelClient) -> LlmAllocator:
    """Through the conversation of the language-model planner, repairs and budget included."""
    config = LlmConfig(
        model="openai/scripted", api_base=server.api_base, timeout_s=20.0, retry_wait_s=0.01
    )
    return LlmAllocator(LanguageModel(config, client), BalancedAllocator())


def answer(**robots: str) -> Reply:
    return Reply({"robots": [{"actor": a, "robot": r} for a, r in robots.items()]})


def test_a_language_model_is_told_what_is_wrong_and_mends_it(client: ModelClient) -> None:
    world, plan = home(TEAM[:2]), drives("", "r2")
    replies = (Reply("no idea"), answer(a0="r9", a1="r1"), answer(a0="r2", a1="r2"))
    with LlmServer(*replies) as server:
        made = by_model(server, client).allocate(checked(plan, world))
    assert isinstance(made, Allocated)
    assert made.allocation == {"a0": "r2", "a1": "r2"}
    told = json.dumps(server.requests[2]["messages"])
    assert "r9 cannot be actor a0; it can be r1, r2" in told
    assert "r1 cannot be actor a1; it can be r2" in told


def test_a_language_model_that_is_never_right_is_replaced_and_that_is_said(
    client: ModelClient,
) -> None:
    world, plan = home(TEAM[:2]), drives("", "")
    with LlmServer(answer(a0="r1")) as server:
        made = by_model(server, client).allocate(checked(plan, world))
    assert isinstance(made, Allocated)
    assert set(made.allocation.values()) == {"r1", "r2"}
    (note,) = made.notes
    assert note.startswith("allocated by balanced and not by language model")
    assert "actor a1 is given no robot" in note


def test_a_language_model_that_fails_stops_nothing() -> None:
    class Unreachable(ModelClient):
        def call(self, request: dict[str, Any], timeout_s: float) -> ModelAnswer:
            raise OSError("no network")

    model = LanguageModel(LlmConfig(model="openai/scripted"), Unreachable())
    made = LlmAllocator(model, RoundRobinAllocator()).allocate(checked(drives(""), home(TEAM[:2])))
    assert isinstance(made, Allocated)
    assert made.notes[0].endswith("asking the language model failed: no network")


def test_what_is_too_large_for_the_solver_is_balanced_without_it() -> None:
    names = tuple(f"r{n}" for n in range(250))
    world = home(tuple(manipulator(name) for name in names))
    plan = drives(*[""] * 1000)
    able = {f"a{n}": names for n in range(1000)}
    load = dict.fromkeys(able, 1)
    problem = AllocationProblem(checked(plan, world), able, load, frozenset())
    made = MilpAllocator()._assign(problem)
    assert isinstance(made, Assignment)
    assert "too many for the solver" in made.notes[0]
    assert set(Counter(made.allocation.values()).values()) == {4}
