"""Ways to a short schedule of an instance, from at once to proven."""
