"""Where to look first: operators by the facts of which one must hold for them to be done."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

from fleet.planners.symbolic.engine.nodes import Nodes


def watch_lists(nodes: Nodes, rows: Sequence[Sequence[int]]) -> dict[int, list[int]]:
    """Rows by the facts of which one must hold for all the nodes of the row to hold; -1: by none.

    Chosen so that few rows are found by the same fact.
    """
    uses: dict[int, int] = defaultdict(int)
    for row in rows:
        for need in row:
            uses[need] += 1
    found_by: dict[int, list[int]] = defaultdict(list)
    known: dict[int, list[int]] = {}
    facts_of = {need: _deciding_facts(nodes, need, known) for need in uses}
    for number, row in enumerate(rows):
        decisive = [need for need in row if facts_of[need]]
        best = min(decisive, key=lambda need: uses[need], default=None)
        for fact in (-1,) if best is None else facts_of[best]:
            found_by[fact].append(number)
    return found_by


def _deciding_facts(nodes: Nodes, node: int, known: dict[int, list[int]]) -> list[int]:
    """Facts of one variable, one of which holds wherever the node does; none if there are none.

    What is `known` of others is used, and more noted; of a circle of nodes nothing is.
    """
    if nodes.variable_of[node] >= 0:
        return [node]
    if node in nodes.rides:
        return [nodes.rides[node].at_robot]
    if node in known:
        return known[node]
    known[node] = []
    axioms = nodes.axioms.get(node, ())
    rows = [[f for n in axiom.needs for f in _deciding_facts(nodes, n, known)] for axiom in axioms]
    variables = [{nodes.variable_of[fact] for fact in row} for row in rows]
    if variables and (shared := set[int].intersection(*variables)):
        variable = min(shared)
        known[node] = sorted({f for row in rows for f in row if nodes.variable_of[f] == variable})
    return known[node]
