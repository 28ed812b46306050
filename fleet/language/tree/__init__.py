"""What a sentence says, as a small tree: clauses, noun phrases, phrases of place."""
