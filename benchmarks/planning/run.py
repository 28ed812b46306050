"""Runs the suite of missions: `python -m benchmarks.planning.run --help`."""

from __future__ import annotations

import argparse
import logging
import shlex
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from dataclasses import replace as changed
from functools import cache
from pathlib import Path

import msgspec
from rich.console import Console
from rich.table import Table

from benchmarks.planning.missions import CLASSES, Mission, load_missions
from benchmarks.planning.report import HEAD, draw, failures_of, rows_of, write_page
from benchmarks.planning.verdict import MissionResult, run_mission
from fleet.llm import LanguageModel, LlmConfig, load_llm_config
from fleet.planners import LlmParaphraser, LlmPlanner
from fleet.service.composition import Composition, compose

STRATEGIES = ("per-goal", "big-dag", "monolithic")
PROCESSES = 2
Work = tuple[str, str, str]
"""Mission, planner, strategy."""


def main() -> int:
    """Run what the command line asks for; 0 if it ran, whatever the missions came to."""
    options = _options()
    logging.basicConfig(level=logging.ERROR)
    only: str | None = options.only
    missions = [m for m in load_missions(only) if options.mission in (None, m.name)]
    if not missions:
        known = ", ".join(m.name for m in load_missions(only))
        sys.stderr.write(f"there is no mission {options.mission}; there are {known}\n")
        return 2
    strategies = STRATEGIES if options.strategy == "all" else (options.strategy,)
    work = [(m.name, options.planner, strategy) for strategy in strategies for m in missions]
    console = Console(width=None if sys.stdout.isatty() else 160)
    began_s = time.perf_counter()
    results: list[MissionResult] = []
    for result in _run(work, options, console):
        results.append(result)
        _print(console, result, options.verbose)
    took_s = time.perf_counter() - began_s
    _show(console, results, took_s)
    _write(results, _out(options), took_s, console)
    return 0


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.planning.run",
        description="Run household missions; the verdict is by what came to be in the world.",
    )
    parser.add_argument("--planner", choices=("symbolic", "llm"), default="symbolic")
    parser.add_argument("--strategy", choices=(*STRATEGIES, "all"), default="all")
    parser.add_argument("--model", help="for --planner llm: as LiteLLM names it")
    parser.add_argument("--llm-config", type=Path, help="a file such as configs/planner.yaml")
    parser.add_argument("--only", choices=CLASSES, help="missions of this class")
    parser.add_argument("--mission", help="only this one")
    parser.add_argument(
        "--out",
        type=Path,
        help="folder for page, picture and results (default: docs/benchmarks "
        "for the whole symbolic suite, otherwise runs/benchmarks)",
    )
    parser.add_argument("--verbose", action="store_true", help="also say why missions failed")
    return parser.parse_args()


def _out(options: argparse.Namespace) -> Path:
    if options.out is not None:
        return Path(options.out)
    whole = (
        options.planner == "symbolic"
        and options.strategy == "all"
        and options.only is None
        and options.mission is None
    )
    return Path("docs/benchmarks") if whole else Path("runs/benchmarks")


def _run(
    work: Sequence[Work], options: argparse.Namespace, console: Console
) -> Iterator[MissionResult]:
    if options.planner == "symbolic":
        with ProcessPoolExecutor(PROCESSES) as pool:
            yield from pool.map(_symbolic, work)
        return
    config = load_llm_config(options.llm_config)
    if options.model:
        config = msgspec.structs.replace(config, model=options.model)
    with ExitStack() as stack:
        parts = _with_model(config, stack)
        for mission, planner, strategy in work:
            yield run_mission(_missions()[mission], parts, planner, strategy)


def _with_model(config: LlmConfig, stack: ExitStack) -> Composition:
    """Everything there is, and a planner and a paraphraser that ask a language model."""
    parts = compose()
    model = LanguageModel(config)
    stack.callback(model.close)
    planner = LlmPlanner(model, parts.planners["symbolic"])
    model.warm()  # LiteLLM's start is no planning time
    return changed(
        parts,
        planners={**parts.planners, planner.name: planner},
        language_model=model,
        paraphraser=LlmParaphraser(model),
    )


@cache
def _missions() -> dict[str, Mission]:
    return {mission.name: mission for mission in load_missions()}


@cache
def _parts() -> Composition:
    return compose()


def _symbolic(work: Work) -> MissionResult:
    mission, planner, strategy = work
    return run_mission(_missions()[mission], _parts(), planner, strategy)


def _print(console: Console, result: MissionResult, verbose: bool) -> None:
    mark = "[green]ok  [/green]" if result.success else "[red]FAIL[/red]"
    console.print(
        f"{mark} {result.mission:12} {result.strategy:10} {result.tasks:3} tasks "
        f"{result.revisions:2} revisions  planning {result.planning_s:6.2f} s  "
        f"makespan {result.makespan_s:4.0f} s",
        highlight=False,
    )
    if verbose and not result.success:
        for sentence in (*result.faults, *(f"reason: {text}" for text in result.reasons[:3])):
            console.print(f"       {sentence}", highlight=False, markup=False)


def _show(console: Console, results: Sequence[MissionResult], took_s: float) -> None:
    for head, rows in (
        (HEAD, rows_of(results)),
        (("mission", "with", "what is wrong", "reasons given"), failures_of(results)),
    ):
        table = Table(*head)
        for row in rows:
            table.add_row(*row)
        console.print(table)
    console.print(f"{len(results)} runs in {took_s:.0f} s", highlight=False)


def _write(results: Sequence[MissionResult], out: Path, took_s: float, console: Console) -> None:
    out.mkdir(parents=True, exist_ok=True)
    command = shlex.join(["python", "-m", "benchmarks.planning.run", *sys.argv[1:]])
    write_page(out / "planning.md", results, command, took_s)
    encoded = msgspec.json.format(msgspec.json.encode(list(results)), indent=1)
    (out / "planning.json").write_bytes(encoded + b"\n")
    try:
        draw(out / "planning.png", results)
    except ModuleNotFoundError:
        console.print("no picture: matplotlib is missing (dependency group `bench`)")
    console.print(f"written: {out}/planning.md, planning.json, planning.png", highlight=False)


if __name__ == "__main__":
    sys.exit(main())
