"""Planners: one file a variant."""
