"""The engine for one subgoal: from skill models to the cheapest sequence of actions."""
