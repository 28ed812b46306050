"""A suite of household missions that judges whole planners by what came to be in the world."""
