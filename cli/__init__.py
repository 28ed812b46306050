"""robotctl: the command line of the fleet."""
