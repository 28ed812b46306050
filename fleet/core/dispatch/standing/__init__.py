"""Goals that make goals: schedules, what stands by, what is kept, and texts that are several."""
