"""Plans as problems of the scheduling solver: between the core's plans and `fleet.jobshop`."""
