"""The grammar, and the chart of all that a sentence can be by it."""
