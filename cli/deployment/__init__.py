"""Robots' workers as containers: what is to be run, and who runs it."""
