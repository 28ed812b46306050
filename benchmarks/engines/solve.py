"""Run by another interpreter, one that has unified-planning: solve a PDDL problem with an engine.

    python solve.py ENGINE DOMAIN PROBLEM TIMEOUT_S

Prints one JSON object: `{"status": …, "seconds": …, "steps": [[action, [argument, …]], …]}`. Needs
nothing of this project, so that the engines stay out of its environment.
"""

from __future__ import annotations

import json
import resource
import sys
from typing import Any


def main() -> None:
    """Solve and print."""
    engine, domain, problem, timeout_s = sys.argv[1:]
    try:
        import unified_planning as up
        from unified_planning.io import PDDLReader
        from unified_planning.shortcuts import OneshotPlanner
    except ImportError:
        return answer(status="not installed")
    up.shortcuts.get_environment().credits_stream = None
    task = PDDLReader().parse_problem(domain, problem)
    try:
        planner = OneshotPlanner(name=engine)
    except Exception as error:  # it says in many ways that an engine is not there
        return answer(status="not installed", why=str(error).splitlines()[0])
    began_s = processor_s()
    try:
        with planner:
            result = planner.solve(task, timeout=float(timeout_s))
    except Exception as error:
        return answer(status="failed", why=f"{type(error).__name__}: {error}".splitlines()[0])
    took_s = processor_s() - began_s
    if result.plan is None:
        return answer(status=result.status.name.lower(), seconds=took_s)
    steps = [
        (step.action.name, [str(argument) for argument in step.actual_parameters])
        for step in _sequence(result.plan)
    ]
    return answer(status="solved", seconds=took_s, steps=steps)


def processor_s() -> float:
    """Processor time [s] of this process and of the processes that it waited for."""
    used = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(one.ru_utime + one.ru_stime for one in used)


def _sequence(plan: Any) -> list[Any]:
    if hasattr(plan, "actions"):
        return list(plan.actions)
    if hasattr(plan, "timed_actions"):
        return [step for _, step, _ in sorted(plan.timed_actions, key=lambda row: row[0])]
    return list(next(iter(plan.all_sequential_plans())).actions)


def answer(**what: Any) -> None:
    """One line of JSON, the last of the output."""
    print("\n" + json.dumps(what))


if __name__ == "__main__":
    main()
