"""Plans of any size, and a world for them: each goal brings a cup to the next room."""

from __future__ import annotations

from msgspec.structs import replace

from benchmarks.scale import errands
from fleet.core.model.world import WorldModel
from keyexpr_schema.payloads.plans import Plan
from tests.support.household import SKILLS


def errand_plan(goals: int, robots: int) -> tuple[Plan, WorldModel]:
    """A plan of four tasks a goal that leaves open which robot does which."""
    plan = replace(errands.Errands("p", range(goals), robots).written("makespan"), pins={})
    facts = [fact for number in range(robots) for fact in errands.robot_facts(number)]
    facts += [errands.cup_fact(number) for number in range(goals)]
    specs = [errands.robot(number) for number in range(robots)]
    world = WorldModel(
        skills=SKILLS,
        places={place.place: place for place in errands.places()},
        objects={thing.object: thing for thing in map(errands.cup, range(goals))},
        robots={spec.robot: spec for spec in specs},
        facts={fact.key: fact.value for fact in facts},
        available=frozenset(spec.robot for spec in specs),
    )
    return plan, world
