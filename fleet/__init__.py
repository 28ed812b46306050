"""The central planner: a pure core, its variants, and the shell that runs them."""
