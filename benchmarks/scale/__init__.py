"""Scale: what an event, an order, a start and an idle hour cost, by size of the fleet and its past."""
