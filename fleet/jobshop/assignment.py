"""The cheapest assignment of rows to columns, where there are at least as many columns.

By shortest augmenting paths (Jonker and Volgenant 1987, without their column reduction): each row
takes a column in turn, along the cheapest way of giving up what was taken. Exact, in
O(rows² · columns). Loading scipy, which has it in C, takes longer than any matrix that is asked
about here.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf


def cheapest_assignment(costs: Sequence[Sequence[float]]) -> list[int]:
    """The column of each row, each column taken at most once, with the least total cost.

    `costs` is `(rows, columns)`, finite, with `rows <= columns`.
    """
    if not costs:
        return []
    columns = range(len(costs[0]))
    row_price = [0.0] * len(costs)
    column_price = [0.0] * len(costs[0])
    row_of = [-1] * len(costs[0])
    column_of = [-1] * len(costs)
    for new in range(len(costs)):
        shortest = [inf] * len(costs[0])
        """The cheapest way to each column, beyond what the prices say."""
        row_before = [-1] * len(costs[0])
        left = set(columns)
        settled: list[int] = []
        row, length = new, 0.0
        while True:
            mine, offset = costs[row], length - row_price[row]
            nearest, least = -1, inf
            for column in left:
                through = mine[column] - column_price[column] + offset
                if through < shortest[column]:
                    shortest[column], row_before[column] = through, row
                if shortest[column] < least:
                    nearest, least = column, shortest[column]
            length = least
            left.remove(nearest)
            if row_of[nearest] < 0:
                break
            settled.append(nearest)
            row = row_of[nearest]
        row_price[new] += length
        for column in settled:
            row_price[row_of[column]] += length - shortest[column]
            column_price[column] -= length - shortest[column]
        column = nearest
        while True:
            row = row_before[column]
            row_of[column] = row
            column_of[row], column = column, column_of[row]
            if row == new:
                break
    return column_of
