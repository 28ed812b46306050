"""Missions in which everything that can fail does, at random and at once, judged from outside."""
