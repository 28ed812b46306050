"""Sharing tasks evenly among robots: pure functions on numbers, which know nothing of plans.

Robots are numbers from 0; a set of robots is an `int` whose bit `r` stands for robot `r`.
"""

from fleet.allocators.load_balancing.balance import Balance, LoadProblem, Unbalanced, balance
from fleet.allocators.load_balancing.classes import Classes, classes_of, classes_of_needs
from fleet.allocators.load_balancing.semimatching import loads_of, semi_matching

__all__ = [
    "Balance",
    "Classes",
    "LoadProblem",
    "Unbalanced",
    "balance",
    "classes_of",
    "classes_of_needs",
    "loads_of",
    "semi_matching",
]
