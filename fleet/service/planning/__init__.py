"""Planning jobs: what one does, the process that runs them, and the pool of such processes."""
