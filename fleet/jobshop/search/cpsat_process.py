"""A process that runs CP-SAT: a shop as JSON on standard input, solutions as JSON lines out.

Run as a script by `fleet.jobshop.search.cpsat`, with nothing of this package imported. A line
is printed for every better solution, so that whoever ends the process early has the best so far;
the last line has the status and the proven bound.

The model: a start and an end for every operation; every block chooses a machine, or a pool of
machines that are alike. Without travel a pool is one cumulative, a single machine one
no-overlap. With travel every machine is a circuit through its blocks, and the travel is part of the
first operation.
"""

from __future__ import annotations

import json
import sys
import time
from collections import Counter
from types import ModuleType
from typing import Any


def main() -> None:
    """Read, solve until the deadline, print."""
    data = json.load(sys.stdin)
    cp_model = _cp_model()
    model = Model(cp_model, data)
    solver = cp_model.CpSolver()
    solver.parameters.max_time_in_seconds = max(data["until"] - time.time(), 0.05)
    solver.parameters.num_workers = data["workers"]
    solver.parameters.random_seed = data["seed"]
    # Searches from the bound upwards. With two or three workers CP-SAT leaves it out, and it is the
    # one that proves most; beside it all that makes a schedule shorter goes on.
    solver.parameters.extra_subsolvers.append("objective_lb_search")

    print_each = type(
        "PrintEach",
        (cp_model.CpSolverSolutionCallback,),
        {"on_solution_callback": lambda self: _print_row(model.answer(self.value))},
    )
    status = solver.solve(model.model, print_each())
    bound = solver.best_objective_bound if status != cp_model.MODEL_INVALID else 0
    _print_row({"status": solver.status_name(status), "bound": bound})


def _cp_model() -> Any:
    """OR-Tools' module without pandas, which it imports for series of variables that are not used
    here, and which would take three quarters of the start: 1.5 s of 2."""
    pandas = ModuleType("pandas")
    for name in ("Index", "Series", "DataFrame"):
        setattr(pandas, name, type(name, (), {}))
    sys.modules["pandas"] = pandas
    try:
        from ortools.sat.python import cp_model
    except (ImportError, AttributeError):
        # Another release of OR-Tools may want more of it.
        for name in [name for name in sys.modules if name.split(".")[0] in ("ortools", "pandas")]:
            del sys.modules[name]
        from ortools.sat.python import cp_model
    return cp_model


def _print_row(row: dict[str, Any]) -> None:
    print(json.dumps(row), flush=True)  # noqa: T201 (standard output is the way out)


class Model:
    """The shop as a CP-SAT model; `cp` is the module `cp_model`, `data` what `request_of` made."""

    def __init__(self, cp: Any, data: dict[str, Any]) -> None:
        self.data = data
        self.model = model = cp.CpModel()
        self.horizon = horizon = data["horizon"]
        self.top = model.new_int_var(data["bound"], horizon, "")
        self.starts = [model.new_int_var(0, horizon, "") for _ in data["operations"]]
        self.ends = [model.new_int_var(0, horizon, "") for _ in data["operations"]]
        self.lits: list[dict[int, Any]] = []
        self.travels: dict[int, list[tuple[Any, int]]] = {}
        """By group: arcs of its circuit with the travel before the block they lead to."""
        for op, row in enumerate(data["operations"]):
            for before in row["predecessors"]:
                model.add(self.starts[op] >= self.ends[before])
            model.add(self.top >= self.ends[op] + row["tail"])
        for block in data["blocks"]:
            lits = {group: model.new_bool_var("") for group in block["groups"]}
            model.add_exactly_one(lits.values())
            self.lits.append(lits)
        self._durations()
        if data["travel"] is None:
            self._cumulatives()
        else:
            self._circuits()
        self._loads()
        for number, block in enumerate(data["blocks"]):
            for other in block["apart"]:
                for group, lit in self.lits[number].items():
                    alone = data["groups"][group]["size"] == 1
                    if alone and other > number and group in self.lits[other]:
                        model.add_at_most_one(lit, self.lits[other][group])
        model.minimize(self.top)
        self._hint()

    def _durations(self) -> None:
        """An operation takes what its machine's kind takes, and at least that where it travels."""
        groups = self.data["groups"]
        for op, row in enumerate(self.data["operations"]):
            lits = self.lits[row["block"]]
            kinds = {groups[group]["kind"] for group in lits}
            durations = row["durations"]
            start, end = self.starts[op], self.ends[op]
            flexible = row["target"] >= 0 and self.data["travel"] is not None
            if len({durations[kind] for kind in kinds}) == 1:
                fixed = durations[next(iter(kinds))]
            else:
                fixed = sum(lit * durations[groups[group]["kind"]] for group, lit in lits.items())
            if flexible:
                self.model.add(end >= start + fixed)
            else:
                self.model.add(end == start + fixed)

    def _span(self, block: int) -> tuple[Any, Any]:
        operations = self.data["blocks"][block]["operations"]
        return self.starts[operations[0]], self.ends[operations[-1]]

    def _cumulatives(self) -> None:
        model, groups = self.model, self.data["groups"]
        intervals: list[list[Any]] = [[] for _ in groups]
        firsts = Counter(
            group
            for block, lits in zip(self.data["blocks"], self.lits, strict=True)
            for group in lits
            if block["position"] == 0
        )
        for number, block in enumerate(self.data["blocks"]):
            begin, end = self._span(number)
            single = len(block["operations"]) == 1 and block["position"] == 1
            # A block that must be first has the machine from the start, one that must be last keeps
            # it to the end. Where several must be first, they come before the others one by one
            # (`_ahead`); in a pool of machines that is left open, and looked at in the answer.
            closes = end if block["position"] < 2 else self.horizon
            for group, lit in self.lits[number].items():
                opens = 0 if block["position"] == 0 and firsts[group] == 1 else begin
                if groups[group]["ready"]:
                    model.add(begin >= groups[group]["ready"]).only_enforce_if(lit)
                if single:
                    row = self.data["operations"][block["operations"][0]]
                    size = row["durations"][groups[group]["kind"]]
                else:
                    size = model.new_int_var(0, self.horizon, "")
                interval = model.new_optional_interval_var(opens, size, closes, lit, "")
                intervals[group].append(interval)
        for number, (group, rows) in enumerate(zip(groups, intervals, strict=True)):
            if group["size"] == 1:
                model.add_no_overlap(rows)
                if firsts[number] > 1:
                    self._ahead(number)
            elif len(rows) > group["size"]:
                model.add_cumulative(rows, [1] * len(rows), group["size"])

    def _ahead(self, group: int) -> None:
        """On this one machine, blocks that must be first end before others begin."""
        mine = [(b, lits[group]) for b, lits in enumerate(self.lits) if group in lits]
        position = [block["position"] for block in self.data["blocks"]]
        for first, first_lit in mine:
            for other, other_lit in mine:
                if position[first] == 0 and position[other] != 0:
                    begins, ends = self._span(other)[0], self._span(first)[1]
                    self.model.add(begins >= ends).only_enforce_if([first_lit, other_lit])

    def _circuits(self) -> None:
        model, data = self.model, self.data
        for number, group in enumerate(data["groups"]):
            mine = [b for b, lits in enumerate(self.lits) if number in lits]
            travel = data["travel"][group["kind"]]
            empty = model.new_bool_var("")
            arcs = [(0, 0, empty)]
            for here, block in enumerate(mine, start=1):
                row = data["blocks"][block]
                lit = self.lits[block][number]
                arcs.append((here, here, ~lit))
                model.add_implication(lit, ~empty)
                first, last = model.new_bool_var(""), model.new_bool_var("")
                arcs += [(0, here, first), (here, 0, last)]
                self._follows(block, number, first, group["ready"], travel[group["site"]])
                if row["position"] == 2:
                    continue
                for there, other in enumerate(mine, start=1):
                    follows = data["blocks"][other]["position"]
                    if here == there or follows < row["position"]:
                        continue
                    arc = model.new_bool_var("")
                    arcs.append((here, there, arc))
                    end = self._span(block)[1]
                    self._follows(other, number, arc, end, travel[row["exit"]])
            model.add_circuit(arcs)

    def _loads(self) -> None:
        """What follows from the rest, and the solver does not see by itself: the work given to the
        machines of a pool, and their ways, fit between the least head and the least tail there."""
        data = self.data
        heads = self._heads()
        for number, group in enumerate(data["groups"]):
            mine = [b for b, lits in enumerate(self.lits) if number in lits]
            if not mine:
                continue
            operations = [data["blocks"][b]["operations"] for b in mine]
            head = min(heads[row[0]] for row in operations)
            tail = min(data["operations"][row[-1]]["tail"] for row in operations)
            if group["ready"] + tail <= data["bound"]:
                # A machine that is free later than that may well have nothing to do.
                head = max(head, group["ready"])
            work = [sum(self._least(op, b, group["kind"]) for op in row)
                    for b, row in zip(mine, operations, strict=True)]  # fmt: skip
            total = sum(s * self.lits[b][number] for b, s in zip(mine, work, strict=True))
            total += sum(way * arc for arc, way in self.travels.get(number, ()))
            self.model.add(total <= group["size"] * (self.top - head - tail))

    def _least(self, op: int, block: int = -1, kind: int = 0) -> int:
        """What an operation takes without its travel: a block's own on this kind of machine, else
        on the fastest."""
        row = self.data["operations"][op]
        durations: list[int] = row["durations"]
        if row["block"] == block:
            return durations[kind]
        groups = self.data["groups"]
        return min(durations[int(groups[group]["kind"])] for group in self.lits[row["block"]])

    def _heads(self) -> list[int]:
        """Before which no op starts."""
        operations = self.data["operations"]
        heads = [-1] * len(operations)
        left = list(range(len(operations)))
        while left:
            waiting = []
            for op in left:
                befores = operations[op]["predecessors"]
                if any(heads[before] < 0 for before in befores):
                    waiting.append(op)
                    continue
                ends = (heads[before] + self._least(before) for before in befores)
                heads[op] = max(ends, default=0)
            left = waiting
        return heads

    def _follows(self, block: int, number: int, arc: Any, free: Any, travel: list[int]) -> None:
        """With this arc, the block comes after `free` on the machine `number`."""
        group = self.data["groups"][number]
        begin, _ = self._span(block)
        self.model.add(begin >= free).only_enforce_if(arc)
        entry = self.data["blocks"][block]["entry"]
        if entry < 0:
            return
        row = self.data["operations"][entry]
        way = travel[row["target"]]
        self.travels.setdefault(number, []).append((arc, way))
        size = row["durations"][group["kind"]] + way
        self.model.add(self.ends[entry] >= self.starts[entry] + size).only_enforce_if(arc)

    def _hint(self) -> None:
        hint = self.data["hint"]
        for op, start in enumerate(hint["starts"]):
            self.model.add_hint(self.starts[op], start)
            self.model.add_hint(self.ends[op], hint["ends"][op])
        for lits, chosen in zip(self.lits, hint["groups"], strict=True):
            for group, lit in lits.items():
                self.model.add_hint(lit, group == chosen)

    def answer(self, value: Any) -> dict[str, Any]:
        """The solution: a start for every block, and its group."""
        return {
            "starts": [value(self._span(b)[0]) for b in range(len(self.lits))],
            "ends": [value(self._span(b)[1]) for b in range(len(self.lits))],
            "groups": [
                next(group for group, lit in lits.items() if value(lit)) for lits in self.lits
            ],
        }


if __name__ == "__main__":
    main()
