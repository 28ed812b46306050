"""Scale: what an event, an order, a start and an idle hour cost, by size and by past."""
