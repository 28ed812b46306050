"""Robot workers: skills, their journal, and the runtime that carries out orders."""
