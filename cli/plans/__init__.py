"""Plans outside the planner: as files, checked, compared."""
