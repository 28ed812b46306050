"""Planning by language model, and goal sentences that the grammar does not take."""
