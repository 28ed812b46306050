"""Runs a mixed-integer solver on a PuLP model, in a process that ends when its time is over.

HiGHS if `highspy` is installed, else the CBC in PuLP's wheel. A process of its own, since CBC has
been seen to overrun a limit of 60 s by 146 s, and HiGHS 1.16 prints to standard output whatever it
is told.
"""

from __future__ import annotations

import importlib.util
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any

import msgspec

GRACE_S = 2.0
"""Wall time past the limit before the process is ended: it writes its answer then."""


class Found(Enum):
    """What a run came to."""

    OPTIMAL = "optimal"
    FEASIBLE = "feasible"
    """Time ran out, or the gap that was allowed is reached."""
    INFEASIBLE = "infeasible"
    """Proven."""
    NOTHING = "nothing"
    """Time ran out before there was any solution, or the solver does not run."""


@dataclass(frozen=True)
class Solved:
    """What was found, and the variables' values by name if it is a solution."""

    found: Found
    values: Mapping[str, float]
    solver: str


class HighsRequest(msgspec.Struct, frozen=True):
    """What highs_process.py is to solve; `start` are values by the names in the MPS file."""

    mps: str
    limit_s: float
    gap: float
    start: dict[str, float]


class HighsAnswer(msgspec.Struct, frozen=True):
    """What it found: a value of `Found`, and values by the names in the MPS file."""

    found: str
    values: dict[str, float]


def available_solver() -> str:
    """`highs` or `cbc`."""
    return "highs" if importlib.util.find_spec("highspy") else "cbc"


def solve(
    model: Any,
    limit_s: float,
    gap: float = 0.0,
    start: Mapping[str, float] | None = None,
    solver: str | None = None,
) -> Solved:
    """Solve a `pulp.LpProblem` within `limit_s` seconds of wall time, to a relative `gap`.

    `start` gives every variable a value, a solution to begin with. `solver` is `highs` or `cbc`;
    without it the one that is there.
    """
    solver = solver or available_solver()
    run = _highs if solver == "highs" else _cbc
    with tempfile.TemporaryDirectory(prefix="allocation-") as folder:
        found, values = run(model, Path(folder), limit_s, gap, start or {})
    return Solved(found, values, solver)


def _highs(
    model: Any, folder: Path, limit_s: float, gap: float, start: Mapping[str, float]
) -> tuple[Found, Mapping[str, float]]:
    mps, answer = folder / "model.mps", folder / "answer.json"
    _, short_names, _, _ = model.writeMPS(str(mps), rename=1)
    begin = {short_names[name]: value for name, value in start.items()}
    request = HighsRequest(str(mps), limit_s, gap, begin)
    (folder / "request.json").write_bytes(msgspec.json.encode(request))
    module = "fleet.allocators.highs_process"
    command = [sys.executable, "-m", module, str(folder / "request.json"), str(answer)]
    if not _ran(command, limit_s) or not answer.exists():
        return Found.NOTHING, {}
    made = msgspec.json.decode(answer.read_bytes(), type=HighsAnswer)
    long_names = {short: name for name, short in short_names.items()}
    return Found(made.found), {long_names[s]: v for s, v in made.values.items() if s in long_names}


def _cbc(
    model: Any, folder: Path, limit_s: float, gap: float, start: Mapping[str, float]
) -> tuple[Found, Mapping[str, float]]:
    import pulp

    # The CBC that lies in PuLP's wheel; `pulp[cbc]` would add 600 MB for the same solver.
    cbc = pulp.COIN_CMD(path=pulp.PULP_CBC_CMD.pulp_cbc_path, msg=False)
    mps, mst, sol = folder / "model.mps", folder / "model.mst", folder / "model.sol"
    variables, names, rows, _ = model.writeMPS(str(mps), rename=1)
    command = [cbc.path, str(mps)]
    if start:
        for variable in variables:
            variable.setInitialValue(start[variable.name], check=False)
        cbc.writesol(str(mst), model, variables, names, rows)
        command += ["-mips", str(mst)]
    command += ["-sec", f"{limit_s:g}", "-timeMode", "elapsed", "-ratio", f"{gap:g}"]
    command += ["-solve", "-printingOptions", "all", "-solution", str(sol)]
    if not _ran(command, limit_s) or not sol.exists():
        return Found.NOTHING, {}
    status, values, _, _, _, sol_status = cbc.readsol_MPS(str(sol), model, variables, names, rows)
    # The status says "Optimal" of time-limited solutions, too; the solution's own does not.
    if sol_status == pulp.LpSolutionOptimal:
        return Found.OPTIMAL, values
    if sol_status == pulp.LpSolutionIntegerFeasible:
        return Found.FEASIBLE, values
    return (Found.INFEASIBLE if status == pulp.LpStatusInfeasible else Found.NOTHING), {}


def _ran(command: list[str], limit_s: float) -> bool:
    """Whether the process ended by itself, and well."""
    try:
        ended = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            timeout=limit_s + GRACE_S,
            check=False,
        )
    except (subprocess.TimeoutExpired, OSError):
        return False
    return ended.returncode == 0
