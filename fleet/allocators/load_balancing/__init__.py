"""Lexicographic min-max load balancing: pure functions on numbers, which know nothing of plans.

Robots are numbers from 0; a set of robots is an `int` whose bit `r` stands for robot `r`.
"""
