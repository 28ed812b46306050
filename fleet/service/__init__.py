"""The shell around the planner's core: keys, clock, journal, planning jobs, processes."""
