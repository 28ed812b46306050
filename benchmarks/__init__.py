"""Measurements: of missions, of the planner, of the key-space."""
