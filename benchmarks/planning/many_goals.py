"""Many goals for many robots at once: how long the symbolic planner takes, and within which limit.

    python -m benchmarks.planning.many_goals [--out FOLDER]

Things lie in thirty rooms, each is wanted in another one; there are four classes of robots, two of
hands that drive and two of carts. Each size is planned in every strategy, with no limit and with
limits, and in planning jobs with the shortest of them, until all goals are planned; limits and
times are of processor time, so that they do not depend on what else goes on.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from math import inf
from pathlib import Path
from random import Random

from rich.console import Console

from benchmarks.planning.goals_in_jobs import Jobs, jobs
from benchmarks.tables import as_json, as_markdown, machine
from fleet.allocators.base import Allocated
from fleet.core.actors import carried_at_end
from fleet.core.model.world import WorldModel
from fleet.jobshop.time_budget import TimeBudget
from fleet.planners.base import BIG_DAG, MONOLITHIC, PER_GOAL, NoPlan, PlanningProblem
from fleet.scheduling.allocation_context import AllocationContext
from fleet.service.composition import Composition, compose
from fleet.service.skill_models import load_all_skills
from keyexpr_schema.facts import AT, HOLDING, NOTHING
from keyexpr_schema.payloads.goals import Condition, Goal
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.world import Fact, Object, Place

STRATEGIES = (PER_GOAL, BIG_DAG, MONOLITHIC)
PLACES, IN_A_ROW, STEP_M = 30, 6, 5.0
LIMITS_S = (5.0, 10.0, 30.0)
ALLOCATION_S = 10.0
SEED = 1


@dataclass(frozen=True)
class Size:
    """How many goals, hands and carts there are, and within how long they should be planned [s]."""

    goals: int
    hands: int
    carts: int
    wanted_s: float

    def __str__(self) -> str:
        return f"{self.goals} x {self.hands + self.carts}"


SIZES = (
    Size(8, 4, 2, 5.0),
    Size(50, 12, 8, 10.0),
    Size(200, 60, 40, 30.0),
    Size(500, 120, 80, 120.0),
)


@dataclass(frozen=True)
class Row:
    """What came of one size in one strategy; `limit_s` is `None` where there was none.

    Without a plan there are no goals in it. `left` counts things that end in a basket.
    """

    size: Size
    strategy: str
    limit_s: float | None
    took_s: float
    goals: int
    tasks: int
    makespan_s: float | None
    left: int

    def cells(self) -> tuple[str, ...]:
        """As a line of the table of plans without a limit."""
        return (
            str(self.size),
            self.strategy,
            f"{self.took_s:.1f} s",
            f"{self.size.wanted_s:g} s",
            f"{self.goals} of {self.size.goals}",
            str(self.tasks),
            "none" if self.makespan_s is None else f"{self.makespan_s:.0f} s",
            str(self.left),
        )


HEAD = (
    "goals x robots",
    "strategy",
    "planned in",
    "wanted",
    "goals",
    "tasks",
    "makespan",
    "left aboard",
)
HEAD_JOBS = (
    "goals x robots",
    "strategy",
    "goals planned by each revision",
    "longest job",
    "makespan",
)
HEAD_LIMITS = ("goals x robots", "strategy", *(f"{limit:g} s" for limit in LIMITS_S))


def main() -> None:
    """Print the tables, and write them where asked."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--out", type=Path, help="folder for many-goals.md, .json and .png")
    options.add_argument("--most", type=int, default=SIZES[-1].goals, help="goals, at most")
    chosen = options.parse_args()
    parts, console = compose(), Console(width=140)
    load = os.getloadavg()[0]
    sizes = [size for size in SIZES if size.goals <= chosen.most]
    rows = []
    for row in measured(sizes, parts):
        console.print(row.limit_s, *row.cells(), highlight=False)
        rows.append(row)
    in_jobs = {}
    for size in sizes:
        world, goals = fleet_of(size)
        for strategy in STRATEGIES:
            in_jobs[size, strategy] = jobs(world, goals, strategy, LIMITS_S[0], parts)
            console.print(size, strategy, in_jobs[size, strategy], highlight=False)
    told = f"{machine()}; load average before it began: {load:.1f}."
    page = _page(sizes, rows, in_jobs)
    console.print(page, told, sep="\n\n", highlight=False)
    if chosen.out is not None:
        _write(chosen.out, sizes, rows, in_jobs, page, told)


def measured(sizes: Sequence[Size], parts: Composition) -> Iterator[Row]:
    """Every size in every strategy, without a limit and with each."""
    for size in sizes:
        world, goals = fleet_of(size)
        for strategy in STRATEGIES:
            for limit_s in (None, *LIMITS_S):
                yield _measured(size, world, goals, strategy, limit_s, parts)


def fleet_of(size: Size, seed: int = SEED) -> tuple[WorldModel, tuple[Goal, ...]]:
    """Rooms in rows, things and robots anywhere, and for each thing another room."""
    chance = Random(seed)
    at_m = {f"room_{i}": (i % IN_A_ROW * STEP_M, i // IN_A_ROW * STEP_M) for i in range(PLACES)}
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
        for i in range(size.goals)
    ]
    facts, goals = [], []
    for number, cup in enumerate(cups):
        origin, target = chance.sample(list(at_m), 2)
        facts.append(_fact(cup.object, AT, origin))
        condition = Condition(relation=AT, subject=cup.object, value=target)
        goals.append(Goal(goal=f"g{number}", text="", ordinal=number, conditions=(condition,)))
    robots = [_hand(i) for i in range(size.hands)] + [_cart(i) for i in range(size.carts)]
    for spec in robots:
        facts.append(_fact(spec.robot, AT, chance.choice(list(at_m))))
        if "grip" in spec.capabilities:
            facts.append(_fact(spec.robot, HOLDING, NOTHING))
    return WorldModel.of(load_all_skills(), places, cups, robots, facts), tuple(goals)


def _hand(number: int) -> RobotSpec:
    kind = number % 2
    able = {"drive": (0.6, 0.4)[kind], "see": 4.0, "grip": 1.2, "reach": 1.0}
    skills = ("navigate", "search", "pick", "place", "place_on_robot", "pick_from_robot")
    return RobotSpec(robot=f"hand_{number}", model=f"hand_{kind}", skills=skills, capabilities=able)


def _cart(number: int) -> RobotSpec:
    kind = number % 2
    able = {"drive": (1.0, 0.8)[kind], "see": 4.0, "basket": (2.0, 4.0)[kind]}
    skills = ("navigate", "search")
    return RobotSpec(robot=f"cart_{number}", model=f"cart_{kind}", skills=skills, capabilities=able)


def _fact(subject: str, relation: str, value: str) -> Fact:
    return Fact(subject=subject, relation=relation, value=value, source="benchmark")


def _measured(
    size: Size,
    world: WorldModel,
    goals: tuple[Goal, ...],
    strategy: str,
    limit_s: float | None,
    parts: Composition,
) -> Row:
    budget = TimeBudget(inf if limit_s is None else limit_s, time.process_time)
    problem = PlanningProblem("p", goals, world, strategy=strategy, budget=budget)
    began_s = time.process_time()
    made = parts.planners["symbolic"].plan(problem)
    took_s = time.process_time() - began_s
    if isinstance(made, NoPlan):
        return Row(size, strategy, limit_s, took_s, 0, 0, None, 0)
    makespan_s = None
    if limit_s is None:
        context = AllocationContext(limit=TimeBudget(ALLOCATION_S))
        found = parts.allocators["makespan"].allocate(made, context)
        makespan_s = found.schedule.makespan_s if isinstance(found, Allocated) else None
    done, tasks = len(made.plan.goals), len(made.plan.tasks)
    left = len(carried_at_end(made))
    return Row(size, strategy, limit_s, took_s, done, tasks, makespan_s, left)


InJobs = Mapping[tuple[Size, str], Jobs]


def _page(sizes: Sequence[Size], rows: Sequence[Row], in_jobs: InJobs) -> str:
    whole = as_markdown(HEAD, [row.cells() for row in rows if row.limit_s is None])
    limited = []
    for size in sizes:
        for strategy in STRATEGIES:
            mine = {r.limit_s: r for r in rows if (r.size, r.strategy) == (size, strategy)}
            cells = (f"{mine[s].goals} of {size.goals} in {mine[s].took_s:.1f} s" for s in LIMITS_S)
            limited.append((str(size), strategy, *cells))
    made = [
        (
            str(size),
            strategy,
            ", ".join(map(str, row.goals)),
            f"{max(row.took_s):.1f} s",
            f"{row.makespan_s:.0f} s",
        )
        for (size, strategy), row in in_jobs.items()
    ]
    return (
        f"{whole}\n\n## With limits\n\n{as_markdown(HEAD_LIMITS, limited)}\n\n"
        "Goals that are not in a plan were postponed: the limit (of processor time) was too short\n"
        "to find a way for them.\n\n"
        f"## In planning jobs of {LIMITS_S[0]:g} s\n\n"
        "As a running planner has it: the planner has half of the limit; messages to and from its\n"
        "process, checks and allocation count as well. What was postponed is planned beside the\n"
        "rest by the next revision.\n\n"
        f"{as_markdown(HEAD_JOBS, made)}"
    )


def _write(
    folder: Path,
    sizes: Sequence[Size],
    rows: Sequence[Row],
    in_jobs: InJobs,
    page: str,
    told: str,
) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    text = (
        "# Many goals for many robots\n\n"
        f"Written by `python -m benchmarks.planning.many_goals`. {told}\n\n"
        f"Each goal is a thing for another one of {PLACES} rooms; hands that drive and carts, two\n"
        "classes of each. Processor time of one process, the checker included; makespans as\n"
        "allocated by `makespan`. What is left aboard is where it should be, in a basket.\n\n"
        f"{page}\n\n"
        "![Time by goals, and goals by limit](many-goals.png)\n"
    )
    folder.joinpath("many-goals.md").write_text(text, encoding="utf-8")
    measured_ = {
        "machine": told,
        "rows": [asdict(row) for row in rows],
        "jobs": [
            {"size": asdict(size), "strategy": strategy, **asdict(row)}
            for (size, strategy), row in in_jobs.items()
        ],
    }
    folder.joinpath("many-goals.json").write_text(as_json(measured_), encoding="utf-8")
    _draw(folder / "many-goals.png", sizes, rows)


def _draw(path: Path, sizes: Sequence[Size], rows: Sequence[Row]) -> None:
    import matplotlib

    matplotlib.use("agg")
    from matplotlib import pyplot

    figure, (left, right) = pyplot.subplots(1, 2, figsize=(10, 4))
    counts = [size.goals for size in sizes]
    for strategy, style in zip(STRATEGIES, ("o-", "s--", "^:"), strict=True):
        mine = [r for r in rows if r.strategy == strategy]
        whole = [next(r.took_s for r in mine if r.limit_s is None and r.size == s) for s in sizes]
        left.plot(counts, whole, style, label=strategy)
        largest = {r.limit_s: r.goals for r in mine if r.size == sizes[-1]}
        right.plot(LIMITS_S, [largest[s] for s in LIMITS_S], style, label=strategy)
    left.plot(counts, [size.wanted_s for size in sizes], "k_", markersize=14, label="wanted")
    left.set(xlabel="goals", ylabel="processor time, s", xscale="log", yscale="log")
    left.set_xticks(counts, labels=[str(size) for size in sizes])
    right.set(xlabel="limit, s", ylabel=f"goals planned, of {sizes[-1]}")
    right.set_xticks(LIMITS_S)
    right.set_ylim(0, 1.05 * sizes[-1].goals)
    for axes in (left, right):
        axes.grid(alpha=0.3)
        axes.legend()
    figure.tight_layout()
    figure.savefig(path, dpi=120)
    pyplot.close(figure)


if __name__ == "__main__":
    main()
