"""Plans of small scenes beside the least makespan there is.

`python -m benchmarks.planning.small_scenes [--scenes 20] [--seed 1] [--seeds 1] [--limit 60]`: a
handful of things to be brought from room to room by hands and carriers (or hands alone), planned
and allocated as the planner does it, and the least makespan by CP-SAT beside it. With several
seeds, a row for each.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from random import Random
from statistics import mean

from rich.console import Console
from rich.table import Table

from benchmarks.planning.optimum import Optimum, least_makespan
from fleet.allocators.base import Allocated
from fleet.core.actors import carried_at_end
from fleet.core.model.world import WorldModel
from fleet.jobshop.time_budget import TimeBudget
from fleet.planners.base import BIG_DAG, NoPlan, PlanningProblem
from fleet.planners.symbolic.action_sequences import UNLOADING_S
from fleet.service.composition import Composition, compose
from fleet.service.skill_models import load_all_skills
from keyexpr_schema.facts import AT, HOLDING, NOTHING
from keyexpr_schema.payloads.goals import Condition, Goal
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.world import Fact, Object, Place

HAND_SKILLS = ("navigate", "pick", "place", "place_on_robot")
PLACES = 5
SIDE_M = 20.0
"""Rooms lie anywhere in a square of this size; robots drive along its axes."""
PLANNING_S = 60.0


@dataclass(frozen=True)
class Scene:
    """Things, robots, and where everything is; a goal for each thing."""

    name: str
    world: WorldModel
    goals: tuple[Goal, ...]


def scenes(count: int, seed: int, carriers: bool) -> Iterator[Scene]:
    """Scenes by chance: two to four things, two hands of different speed, up to two carriers."""
    chance = Random(seed)
    for number in range(count):
        things = chance.randint(2, 4)
        carts = chance.randint(1, 2) if carriers else 0
        yield scene(f"{things} things, 2 hands, {carts} carriers, {number}", chance, things, carts)


def scene(name: str, chance: Random, things: int, carts: int) -> Scene:
    """One scene."""
    at_m = {
        f"room_{i}": (chance.uniform(0.0, SIDE_M), chance.uniform(0.0, SIDE_M))
        for i in range(PLACES)
    }
    places = [
        Place(
            place=p,
            label=p,
            travel_m={q: abs(x - u) + abs(y - v) for q, (u, v) in at_m.items() if q != p},
        )
        for p, (x, y) in at_m.items()
    ]
    cups = [
        Object(object=f"cup_{i}", kind="cup", label=f"cup {i}", ordinal=i + 1, mass_kg=0.15)
        for i in range(things)
    ]
    robots = [_hand(f"hand_{i}", speed) for i, speed in enumerate((0.6, 0.3))]
    robots += [_carrier(f"carrier_{i}", basket) for i, basket in enumerate((2, 3)[:carts])]
    facts, goals = [], []
    for number, cup in enumerate(cups):
        origin, target = chance.sample(sorted(at_m), 2)
        facts.append(_fact(cup.object, AT, origin))
        condition = Condition(relation=AT, subject=cup.object, value=target)
        goals.append(Goal(goal=f"g{number}", text="", conditions=(condition,), ordinal=number))
    for spec in robots:
        facts.append(_fact(spec.robot, AT, chance.choice(sorted(at_m))))
        if "grip" in spec.capabilities:
            facts.append(_fact(spec.robot, HOLDING, NOTHING))
    world = WorldModel.of(load_all_skills(), places, cups, robots, facts)
    return Scene(name, world, tuple(goals))


def _hand(name: str, speed_m_s: float) -> RobotSpec:
    able = {"drive": speed_m_s, "see": 4.0, "grip": 1.2, "reach": 1.0}
    return RobotSpec(robot=name, model=f"at {speed_m_s}", skills=HAND_SKILLS, capabilities=able)


def _carrier(name: str, basket: int) -> RobotSpec:
    able = {"drive": 1.0, "basket": float(basket)}
    return RobotSpec(robot=name, model="carrier", skills=("navigate",), capabilities=able)


def _fact(subject: str, relation: str, value: str) -> Fact:
    return Fact(subject=subject, relation=relation, value=value, source="benchmark")


def planned_s(made: Scene, parts: Composition, strategy: str = BIG_DAG) -> float | str:
    """What the plan of a scene is predicted to take [s], or why there is none.

    As the planner counts: the makespan, and more for what is left in a basket.
    """
    problem = PlanningProblem(
        plan="p",
        goals=made.goals,
        world=made.world,
        strategy=strategy,
        budget=TimeBudget(PLANNING_S),
    )
    plan = parts.planners["symbolic"].plan(problem)
    if isinstance(plan, NoPlan):
        return plan.reason
    found = parts.allocators["makespan"].allocate(plan)
    if not isinstance(found, Allocated):
        return found.violations[0].sentence
    return found.schedule.makespan_s + UNLOADING_S * len(carried_at_end(plan))


@dataclass(frozen=True)
class Compared:
    """A scene's planned makespan [s], or why there is none, and the least there is."""

    scene: str
    planned_s: float | str
    optimum: Optimum | None

    @property
    def ratio(self) -> float | None:
        """Planned by optimum."""
        if isinstance(self.planned_s, str) or self.optimum is None:
            return None
        return self.planned_s / self.optimum.makespan_s


def compared(made: Scene, parts: Composition, limit_s: float) -> Compared:
    """A scene's plan beside the optimum, for which CP-SAT has so long."""
    least = least_makespan(made.world, made.goals, UNLOADING_S, limit_s)
    return Compared(made.name, planned_s(made, parts), least)


def main() -> None:
    """Print the tables."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--scenes", type=int, default=20)
    options.add_argument("--seed", type=int, default=1, help="the first")
    options.add_argument("--seeds", type=int, default=1, help="how many")
    options.add_argument("--limit", type=float, default=60.0, help="of CP-SAT for a scene, s")
    chosen = options.parse_args()
    console, parts = Console(width=120), compose()
    for carriers in (True, False):
        title = "with carriers" if carriers else "hands only"
        by_seed = {
            seed: [
                compared(made, parts, chosen.limit)
                for made in scenes(chosen.scenes, seed, carriers)
            ]
            for seed in range(chosen.seed, chosen.seed + chosen.seeds)
        }
        console.print(
            _table(by_seed[chosen.seed], title) if chosen.seeds == 1 else _summary(by_seed, title)
        )


def _table(rows: list[Compared], title: str) -> Table:
    table = Table("scene", "planned", "least", "proven", "planned ÷ least", title=title)
    for row in rows:
        planned = row.planned_s if isinstance(row.planned_s, str) else f"{row.planned_s:.1f} s"
        least = "none" if row.optimum is None else f"{row.optimum.makespan_s:.1f} s"
        proven = "yes" if row.optimum is not None and row.optimum.proven else "no"
        ratio = "" if row.ratio is None else f"{row.ratio:.3f}"
        table.add_row(row.scene, planned, least, proven, ratio)
    ratios = [row.ratio for row in rows if row.ratio is not None]
    if ratios:
        table.add_row("mean", "", "", "", f"{mean(ratios):.3f}")
        table.add_row("worst", "", "", "", f"{max(ratios):.3f}")
    return table


def _summary(by_seed: dict[int, list[Compared]], title: str) -> Table:
    table = Table("seed", "scenes", "planned", "proven", "mean", "worst", title=title)
    everything = [row for rows in by_seed.values() for row in rows]
    for name, rows in (*by_seed.items(), ("all", everything)):
        ratios = [row.ratio for row in rows if row.ratio is not None]
        proven = sum(row.optimum is not None and row.optimum.proven for row in rows)
        numbers = (f"{mean(ratios):.3f}", f"{max(ratios):.3f}") if ratios else ("", "")
        table.add_row(str(name), str(len(rows)), str(len(ratios)), str(proven), *numbers)
    return table


if __name__ == "__main__":
    main()
