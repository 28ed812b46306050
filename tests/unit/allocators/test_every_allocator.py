"""What holds of every allocator but the scheduling one, on households, and why one refuses."""

from __future__ import annotations

import pytest

from fleet.allocators.base import Allocated, AllocationProblem, Allocator, Assignment, NotAllocated
from fleet.allocators.cost_based import CostBasedAllocator
from fleet.allocators.min_max_load import MinMaxLoadAllocator, TieBreak
from fleet.allocators.round_robin import RoundRobinAllocator
from fleet.core.checker.plan_checker import CheckedPlan, check_allocation
from fleet.core.model.world import WorldModel
from fleet.planners.base import PlanningProblem
from fleet.planners.symbolic.planner import SymbolicPlanner
from keyexpr_schema.payloads.plans import Plan, Task
from tests.support.household import bring, carrier, checked, drives, home, manipulator

PLAIN = (
    MinMaxLoadAllocator(TieBreak.NEXT_LOADS),
    MinMaxLoadAllocator(TieBreak.TRAVEL),
    CostBasedAllocator(),
    RoundRobinAllocator(),
)
TEAM = (manipulator("r1"), manipulator("r2"), manipulator("r3"), carrier("c1"), carrier("c2"))


def plan_for(world: WorldModel, goals: int) -> Plan:
    wanted = [bring(n, "hallway" if n % 2 else "living_room") for n in range(1, goals + 1)]
    made = SymbolicPlanner().plan(PlanningProblem("p", tuple(wanted), world))
    assert isinstance(made, CheckedPlan), made
    return made.plan


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


class Careless(Allocator):
    """Answers what it was made with, whatever it is asked."""

    name = "careless"

    def __init__(self, answer: dict[str, str]) -> None:
        self.answer = answer

    def _assign(self, problem: AllocationProblem) -> Assignment:
        return Assignment(self.answer)


@pytest.mark.parametrize("answer", [{}, {"a0": "martian"}, {"a0": "c1"}])
def test_an_answer_with_robots_that_cannot_be_the_actors_is_refused(answer: dict[str, str]) -> None:
    made = Careless(answer).allocate(checked(drives("c2"), home(TEAM)))
    assert isinstance(made, NotAllocated)
    said = f"allocator careless makes {answer.get('a0')} actor a0, not c2"
    assert [violation.sentence for violation in made.violations] == [said]


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
    sentence = refused.violations[0].sentence
    assert "actors b1 and b2 must all be different robots" in sentence
    assert "each still has a load at the end" in sentence
    assert "only c1 can be any of them" in sentence


def task(name: str, skill: str, args: dict[str, str], *after: str) -> Task:
    return Task(task=name, skill=skill, args=args, actor=args["robot"][1:], after=after)
