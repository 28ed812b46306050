"""A task as if nothing ever ceased to hold: what makes which nodes true, as rows.

Operators, what they make true where more holds, axioms, and counts of which so many must hold.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from typing import NamedTuple

from fleet.planners.symbolic.engine.finite_domain import FiniteDomainTask
from fleet.planners.symbolic.engine.nodes import Stands

AXIOM = -1
"""In place of an operator, for what only follows."""


class RelaxedRow(NamedTuple):
    """Nodes that hold as soon as `least` of others do, with robots where they have to be."""

    needs: tuple[int, ...]
    least: int
    stands: Stands
    writes: tuple[int, ...]
    operator: int = AXIOM


def relaxed_rows(task: FiniteDomainTask) -> list[RelaxedRow]:
    """All rows: those of operators first, under their numbers, and last that of the goal."""
    rows = [
        _row(operator.needs, operator.stands, (*operator.writes, *task.also.get(n, ())), n)
        for n, operator in enumerate(task.operators)
    ]
    for n, operator in enumerate(task.operators):
        rows += [
            _row((*operator.needs, *when), operator.stands, (fact,), n)
            for when, fact in operator.may_write
        ]
    for axioms in task.nodes.axioms.values():
        rows += [_row(axiom.needs, axiom.stands, (axiom.reading,)) for axiom in axioms]
    rows += _counts(task)
    rows.append(_row(task.goal_needs, task.goal_stands, ()))
    return rows


def _row(
    needs: tuple[int, ...], stands: Stands, writes: tuple[int, ...], operator: int = AXIOM
) -> RelaxedRow:
    distinct = tuple(set(needs))
    return RelaxedRow(distinct, len(distinct), stands, writes, operator)


def _counts(task: FiniteDomainTask) -> Iterator[RelaxedRow]:
    free = len(task.nodes)
    for node, counted in task.nodes.quorums.items():
        met = tuple(range(free, free + len(counted)))
        free += len(counted)
        for number, (of, least) in zip(met, counted, strict=True):
            yield RelaxedRow(of, least, (), (number,))
        yield _row(met, (), (node,))


def reachable(task: FiniteDomainTask) -> set[int]:
    """The nodes that can hold as if nothing ever ceased to."""
    rows = relaxed_rows(task)
    open_ = [row.least for row in rows]
    used_by: dict[int, list[int]] = defaultdict(list)
    for number, row in enumerate(rows):
        for need in row.needs:
            used_by[need].append(number)
    true = set(task.nodes.true_nodes(task.initial))
    todo = list(true)
    ready = [number for number, left in enumerate(open_) if left <= 0]
    while todo or ready:
        for number in ready:
            todo += [node for node in rows[number].writes if node not in true]
            true.update(rows[number].writes)
        ready = []
        if todo:
            for number in used_by.get(todo.pop(), ()):
                open_[number] -= 1
                if open_[number] == 0:
                    ready.append(number)
    return true
