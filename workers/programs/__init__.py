"""Skill programs: a Python subset over a robot's skills, run in a sandbox call by call."""
