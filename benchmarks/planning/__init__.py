"""A suite of household missions for whole planners; the verdict is what came to be in the world."""
