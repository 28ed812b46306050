"""Skill programs written with no network: from a symbolic plan for one robot to a text."""
