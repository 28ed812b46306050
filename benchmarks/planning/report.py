"""Tables and a picture of how missions went."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path

from benchmarks.planning.missions import CLASSES
from benchmarks.planning.verdict import MissionResult
from benchmarks.tables import as_markdown, machine

HEAD = (
    "planner",
    "strategy",
    "class",
    "success",
    "tasks",
    "revisions",
    "rounds",
    "fallbacks",
    "planning, median",
    "planning, worst",
    "makespan",
)
Row = tuple[str, ...]


def rows_of(results: Sequence[MissionResult]) -> list[Row]:
    """A row for each planner, strategy and class, and one for all classes together.

    Tasks, revisions, rounds and makespan [simulated s] are means over those missions to be done
    that every planner and strategy carried out, so that rows can be compared; planning [CPU s] is
    of all missions.
    """
    comparable = comparable_missions(results)
    rows: list[Row] = []
    for planner, strategy in variants(results):
        mine = [r for r in results if (r.planner, r.strategy) == (planner, strategy)]
        for kind in (*CLASSES, "all"):
            some = [r for r in mine if kind in (r.kind, "all")]
            if not some:
                continue
            done = [r for r in some if r.mission in comparable]
            seconds = sorted(r.planning_s for r in some)
            rows.append(
                (
                    planner,
                    strategy,
                    kind,
                    f"{sum(r.success for r in some)}/{len(some)}",
                    _mean(done, lambda r: r.tasks),
                    _mean(done, lambda r: r.revisions),
                    _mean(some, lambda r: r.rounds),
                    str(sum(r.fallbacks > 0 for r in some)),
                    f"{seconds[len(seconds) // 2]:.2f} s",
                    f"{seconds[-1]:.2f} s",
                    _mean(done, lambda r: r.makespan_s, " s"),
                )
            )
    return rows


def variants(results: Sequence[MissionResult]) -> tuple[tuple[str, str], ...]:
    """Every planner and strategy there is a result of, in the order of the results."""
    return tuple(dict.fromkeys((r.planner, r.strategy) for r in results))


def comparable_missions(results: Sequence[MissionResult]) -> frozenset[str]:
    """Missions to be done that every planner and strategy carried out."""
    failed = {r.mission for r in results if not r.success or r.outcome != "done"}
    return frozenset(r.mission for r in results) - failed


def _mean(
    results: Sequence[MissionResult], of: Callable[[MissionResult], float], unit: str = ""
) -> str:
    if not results:
        return "-"
    return f"{sum(of(r) for r in results) / len(results):.1f}{unit}"


def failures_of(results: Sequence[MissionResult]) -> list[Row]:
    """A row for each mission that did not come out right: what is wrong, and the reasons given."""
    rows: list[Row] = []
    for mission in dict.fromkeys(r.mission for r in results if not r.success):
        failed = [r for r in results if r.mission == mission and not r.success]
        where = sorted({f"{r.planner} {r.strategy}" for r in failed})
        every = len(failed) == sum(r.mission == mission for r in results)
        rows.append(
            (
                mission,
                "everywhere" if every else ", ".join(where),
                _cell("; ".join(failed[0].faults)),
                _cell("; ".join(failed[0].reasons[:2])),
            )
        )
    return rows


def _cell(text: str, most: int = 300) -> str:
    short = text if len(text) <= most else text[:most] + " …"
    return short.replace("|", "\\|").replace("\n", " ")


def write_page(path: Path, results: Sequence[MissionResult], command: str, took_s: float) -> None:
    """The page about the suite, with the picture beside it."""
    missions = len({r.mission for r in results})
    comparable = len(comparable_missions(results))
    packages = ", ".join(f"{name} {version(name)}" for name in ("pulp", "mujoco"))
    text = f"""# Household missions

Written by `{command}` in {took_s:.0f} s on {machine()} ({packages}).

{missions} missions, written by hand in `benchmarks/planning/missions`: sentences (a few goals of
the apartment's are conditions, with what must never hold), a world, what the planner believes of
it, and what must really be true at the end. They go through the planner's own core and planning
jobs; robots carry the orders out with the workers' own skills and retries in a kinematic world
(`sim.kinematic.backend`: drives take the route's length, things do not fall). Those in the
apartment (`configs/worlds/apartment.yaml` with `benchmarks/planning/settings`) also use tools,
water, machines that take their time and hands of two robots
(`benchmarks/planning/household_world.py` says what that does, and to whom it does nothing); robots
die, handles slip, people move things.

A mission succeeds if that world is then as the mission file says, if nothing was moved or changed
that the mission does not speak of, if what must never hold never did, and if the planner's own
statuses agree. Those that must be refused succeed if nothing is done and the reason names what is
missing; those to be given up, if a reason is given. Random seeds are fixed; the simulated clock
stands still while the planner thinks.

`planning` is CPU time for all revisions of a mission. Tasks begun, revisions and makespan
(simulated) are means over the {comparable} missions to be done that succeeded in every row group,
so that they can be compared. Rounds are answers of a language model to the planner; fallbacks are
missions in which the symbolic planner had to take over from it.

{as_markdown(HEAD, rows_of(results))}

![Success, plan length, makespan and planning time](planning.png)

## What did not come out right

{as_markdown(("mission", "with", "what is wrong", "reasons given"), failures_of(results))}
"""
    path.write_text(text, encoding="utf-8")


def draw(path: Path, results: Sequence[MissionResult]) -> None:
    """Four small charts by class, a bar for each planner and strategy."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    comparable = comparable_missions(results)
    charts: tuple[tuple[str, Callable[[list[MissionResult]], float], bool], ...] = (
        ("missions that came out right, %", _success_percent, False),
        ("tasks begun, mean", lambda rs: _average([r.tasks for r in rs]), True),
        ("makespan, simulated s, mean", lambda rs: _average([r.makespan_s for r in rs]), True),
        ("planning, CPU s, mean", lambda rs: _average([r.planning_s for r in rs]), False),
    )
    kinds = [kind for kind in CLASSES if any(r.kind == kind for r in results)]
    groups = variants(results)
    width = 0.8 / len(groups)
    figure, axes = plt.subplots(2, 2, figsize=(11, 7), layout="constrained")
    for axis, (title, value, only_comparable) in zip(axes.flat, charts, strict=True):
        for number, (planner, strategy) in enumerate(groups):
            heights = [
                value(
                    [
                        r
                        for r in results
                        if (r.planner, r.strategy, r.kind) == (planner, strategy, kind)
                        and (not only_comparable or r.mission in comparable)
                    ]
                )
                for kind in kinds
            ]
            places = [i + (number - (len(groups) - 1) / 2) * width for i in range(len(kinds))]
            bars = axis.bar(places, heights, width * 0.92, label=f"{planner}, {strategy}")
            axis.bar_label(bars, fmt=_short, fontsize=7, padding=1)
        axis.set_title(title, fontsize=10)
        axis.set_xticks(range(len(kinds)), kinds)
        axis.spines[["top", "right"]].set_visible(False)
        axis.margins(y=0.12)
    handles, labels = axes.flat[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(groups), frameon=False)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _short(value: float) -> str:
    return f"{value:.2f}" if value < 1 else f"{value:.1f}".removesuffix(".0")


def _success_percent(results: list[MissionResult]) -> float:
    return 100.0 * _average([float(r.success) for r in results])


def _average(values: Sequence[float]) -> float:
    return sum(values) / len(values) if values else 0.0
