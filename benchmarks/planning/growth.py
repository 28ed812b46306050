"""One goal in ever larger worlds, and goals that need tools: our engine beside Fast Downward.

    python -m benchmarks.planning.growth [--python VENV/bin/python] [--out FOLDER]

A cup is brought from one corner of a grid of rooms to the other, by arms and carts of two kinds
each; bread is sliced with a knife, a plant watered with a jug, in 13 rooms with 19 things. Fast
Downward (LAMA, first plan) gets the same skills as PDDL through unified-planning, in an interpreter
of its own that is named with `--python` (`pip install unified-planning up-fast-downward`); without,
it is left out. Times are of one run each; the makespan is that of the plan, allocated anew by
`makespan`.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from rich.console import Console

from benchmarks.engines.run import SolvedOutside, solved_outside
from benchmarks.tables import as_json, as_markdown, machine
from fleet.allocators.base import Allocated
from fleet.core.checker.plan_checker import CheckedPlan
from fleet.core.model.skill_file import skills_from_data
from fleet.core.model.world import WorldModel
from fleet.planners.base import NoPlan, PlanningProblem
from fleet.service.composition import Composition, compose
from fleet.service.skill_models import load_all_skills
from keyexpr_schema.facts import AT, HOLDING, NOTHING
from keyexpr_schema.payloads.goals import Condition, Goal
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.world import Fact, Object, Place

PLACES = (7, 15, 20, 40, 60, 120)
TOOL_PLACES, TOOL_THINGS = 13, 19
FIXED = ("plant", "tap")
STEP_M = 4.0
TOOLS = {
    "slice": {
        "parameters": {"robot": "robot", "object": "bread", "tool": "knife", "place": "place"},
        "needs": {"robot": ["grip"]},
        "before": ["at(robot) = place", "at(object) = place", "holding(robot) = tool"],
        "after": ["sliced(object) = true"],
        "duration_s": 60,
    },
    "fill": {
        "parameters": {"robot": "robot", "jug": "jug", "tap": "tap", "place": "place"},
        "needs": {"robot": ["grip"]},
        "before": ["at(robot) = place", "at(tap) = place", "holding(robot) = jug"],
        "after": ["filled(jug) = true"],
        "duration_s": 20,
    },
    "water": {
        "parameters": {"robot": "robot", "plant": "plant", "jug": "jug", "place": "place"},
        "needs": {"robot": ["grip"]},
        "before": [
            "at(robot) = place",
            "at(plant) = place",
            "holding(robot) = jug",
            "filled(jug) = true",
        ],
        "after": ["watered(plant) = true", "filled(jug) = false"],
        "duration_s": 30,
    },
}


@dataclass(frozen=True)
class Row:
    """What came of one problem; times and makespans in seconds, `None` where there is no plan."""

    problem: str
    own_s: float
    own_tasks: int | None
    own_makespan_s: float | None
    outside: SolvedOutside | None

    def cells(self) -> tuple[str, ...]:
        """As a line of the table."""
        fast = self.outside
        return (
            self.problem,
            f"{self.own_s:.2f} s",
            "none" if self.own_tasks is None else str(self.own_tasks),
            _seconds(self.own_makespan_s),
            "" if fast is None else _seconds(fast.planning_s, 2) or fast.outcome,
            "" if fast is None or fast.tasks is None else str(fast.tasks),
            "" if fast is None else _seconds(fast.reallocated_s or fast.makespan_s),
        )


HEAD = (
    "problem",
    "own engine",
    "tasks",
    "makespan",
    "Fast Downward",
    "tasks",
    "makespan",
)


def main() -> None:
    """Print the table, and write it where asked."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--python", help="the interpreter that has unified-planning")
    options.add_argument("--timeout", type=float, default=60.0, help="of Fast Downward, s")
    options.add_argument("--out", type=Path, help="folder for growth.md, growth.json, growth.png")
    chosen = options.parse_args()
    parts, console = compose(), Console(width=140)
    load = os.getloadavg()[0]
    rows = []
    for name, world, goal in problems():
        rows.append(_measured(name, world, goal, parts, chosen.python, chosen.timeout))
        console.print("  ".join(rows[-1].cells()), highlight=False)
    page = as_markdown(HEAD, [row.cells() for row in rows])
    told = f"{machine()}; load average before it began: {load:.1f}."
    console.print(page, told, sep="\n\n", highlight=False)
    if chosen.out is not None:
        _write(chosen.out, rows, page, told)


def problems() -> Iterator[tuple[str, WorldModel, Goal]]:
    """By name: worlds, each with its goal."""
    for number in PLACES:
        yield f"bring, {number} places", *bringing(number)
    size = f"{TOOL_PLACES} places, {TOOL_THINGS} things"
    for name, subject in (("sliced", "bread"), ("watered", "plant")):
        yield f"{name}, {size}", tools(), _goal(name, subject, True)


def bringing(number: int) -> tuple[WorldModel, Goal]:
    """A grid of rooms, two kinds of arms and of carts, and a cup that is wanted far away."""
    cup = Object(object="cup", kind="cup", label="cup", mass_kg=0.15)
    facts = [_fact("cup", AT, "room_1")]
    world = _world(number, [cup], facts, ())
    return world, _goal(AT, "cup", f"room_{number - 1}")


def tools() -> WorldModel:
    """Bread, a plant, a tap; a knife and a jug in the last rooms, and a dozen other things."""
    kinds = ["bread", "plant", "tap", "knife", "jug"]
    things = [(kind, kind, 2 * n) for n, kind in enumerate(kinds)]
    things += [(f"toy_{n}", "toy", n % TOOL_PLACES) for n in range(TOOL_THINGS - len(kinds))]
    objects = [
        Object(object=name, kind=kind, label=name, mass_kg=0.3, movable=kind not in FIXED)
        for name, kind, _ in things
    ]
    facts = [_fact(name, AT, f"room_{room}") for name, _, room in things]
    undone = (("sliced", "bread"), ("filled", "jug"), ("watered", "plant"))
    facts += [_fact(subject, relation, False) for relation, subject in undone]
    return _world(TOOL_PLACES, objects, facts, tuple(TOOLS))


def _world(
    number: int, objects: Sequence[Object], facts: Sequence[Fact], more: tuple[str, ...]
) -> WorldModel:
    side = int(number**0.5)

    def way_m(i: int, j: int) -> float:
        return STEP_M * (abs(i // side - j // side) + abs(i % side - j % side))

    places = [
        Place(
            place=f"room_{i}",
            label=f"room {i}",
            travel_m={f"room_{j}": way_m(i, j) for j in range(number) if j != i},
        )
        for i in range(number)
    ]
    robots = []
    for kind in range(2):
        hands = {"drive": 0.4 + 0.2 * kind, "see": 4.0, "grip": 1.2, "reach": 1.0}
        able = ("navigate", "search", "pick", "place", "place_on_robot", *more)
        robots.append(
            RobotSpec(robot=f"arm_{kind}", model=f"arm {kind}", skills=able, capabilities=hands)
        )
        basket = {"drive": 0.6 + 0.3 * kind, "see": 4.0, "basket": 2.0}
        robots.append(
            RobotSpec(
                robot=f"cart_{kind}",
                model=f"cart {kind}",
                skills=("navigate", "search"),
                capabilities=basket,
            )
        )
    known = [*facts]
    for n, spec in enumerate(robots):
        known.append(_fact(spec.robot, AT, f"room_{(7 * n + 3) % number}"))
        if "grip" in spec.capabilities:
            known.append(_fact(spec.robot, HOLDING, NOTHING))
    skills = {**load_all_skills(), **skills_from_data({"skills": TOOLS}, "tools")}
    return WorldModel.of(skills, places, objects, robots, known)


def _fact(subject: str, relation: str, value: str | bool) -> Fact:
    return Fact(subject=subject, relation=relation, value=value, source="benchmark")


def _goal(relation: str, subject: str, value: str | bool) -> Goal:
    wanted = Condition(relation=relation, subject=subject, value=value)
    return Goal(goal="g", text="", conditions=(wanted,))


def _measured(
    name: str, world: WorldModel, goal: Goal, parts: Composition, python: str | None, limit_s: float
) -> Row:
    problem = PlanningProblem(plan="p", goals=(goal,), world=world)
    began_s = time.process_time()
    made = parts.planners["symbolic"].plan(problem)
    took_s = time.process_time() - began_s
    outside = None
    if python is not None:
        outside = solved_outside("fast-downward", world, (goal,), parts, python, limit_s)
    if isinstance(made, NoPlan):
        return Row(name, took_s, None, None, outside)
    return Row(name, took_s, len(made.plan.tasks), _makespan_s(made, parts), outside)


def _makespan_s(made: CheckedPlan, parts: Composition) -> float | None:
    found = parts.allocators["makespan"].allocate(made)
    return found.schedule.makespan_s if isinstance(found, Allocated) else None


def _seconds(value: float | None, digits: int = 0) -> str:
    return "" if value is None else f"{value:.{digits}f} s"


def _write(folder: Path, rows: Sequence[Row], page: str, told: str) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    text = (
        "# One goal in large worlds\n\n"
        f"Written by `python -m benchmarks.planning.growth`. {told}\n\n"
        "Processor time of our planner, checker included, and of Fast Downward (LAMA, first\n"
        "plan), without starting unified-planning. Makespans as allocated by `makespan`.\n\n"
        f"{page}\n\n![Time by places](growth.png)\n"
    )
    folder.joinpath("growth.md").write_text(text, encoding="utf-8")
    measured = {"machine": told, "rows": [asdict(row) for row in rows]}
    folder.joinpath("growth.json").write_text(as_json(measured), encoding="utf-8")
    _draw(folder / "growth.png", rows[: len(PLACES)])


def _draw(path: Path, rows: Sequence[Row]) -> None:
    import matplotlib

    matplotlib.use("agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(7, 4))
    axes.plot(PLACES, [row.own_s for row in rows], "o-", label="own engine")
    fast = [row.outside.planning_s if row.outside else None for row in rows]
    if any(fast):
        known = [(n, s) for n, s in zip(PLACES, fast, strict=True) if s is not None]
        axes.plot(*zip(*known, strict=True), "s--", label="Fast Downward")
    axes.set(xlabel="places", ylabel="processor time, s", xscale="log", yscale="log")
    axes.set_xticks(PLACES, labels=[str(n) for n in PLACES])
    axes.grid(alpha=0.3)
    axes.legend()
    figure.tight_layout()
    figure.savefig(path, dpi=120)
    pyplot.close(figure)


if __name__ == "__main__":
    main()
