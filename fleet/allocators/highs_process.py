"""HiGHS in a process of its own: `python -m fleet.allocators.highs_process REQUEST ANSWER`."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from typing import Any

import msgspec

from fleet.allocators.solver_run import Found, HighsAnswer, HighsRequest


def main(request_file: Path, answer_file: Path) -> None:
    """Solve what the request asks for, and write the answer.

    Raises:
        RuntimeError: HiGHS cannot read the model.
    """
    highspy: Any = importlib.import_module("highspy")  # an extra, unknown to type checkers
    request = msgspec.json.decode(request_file.read_bytes(), type=HighsRequest)
    highs = highspy.Highs()
    highs.setOptionValue("output_flag", False)
    highs.setOptionValue("time_limit", request.limit_s)
    highs.setOptionValue("mip_rel_gap", request.gap)
    if highs.readModel(request.mps) != highspy.HighsStatus.kOk:
        raise RuntimeError(f"HiGHS cannot read {request.mps}")
    names = list(highs.getLp().col_names_)
    if request.start:
        begin = highspy.HighsSolution()
        begin.col_value = [request.start.get(name, 0.0) for name in names]
        highs.setSolution(begin)
    highs.run()
    status = highs.getModelStatus()
    found, values = Found.NOTHING, {}
    if highs.getInfo().primal_solution_status == highspy.kSolutionStatusFeasible:
        optimal = status == highspy.HighsModelStatus.kOptimal
        found = Found.OPTIMAL if optimal else Found.FEASIBLE
        values = dict(zip(names, map(float, highs.getSolution().col_value), strict=True))
    elif status == highspy.HighsModelStatus.kInfeasible:
        found = Found.INFEASIBLE
    answer_file.write_bytes(msgspec.json.encode(HighsAnswer(found.value, values)))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
