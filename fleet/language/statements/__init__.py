"""Statements: sentences that say what holds, to facts."""
