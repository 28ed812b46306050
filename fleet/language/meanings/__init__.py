"""What the clauses of a text add up to: goals with their conditions and times, tasks."""
