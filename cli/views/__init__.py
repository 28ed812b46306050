"""How robotctl draws what it read: pure functions from payloads to what rich can print."""
