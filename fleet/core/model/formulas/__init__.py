"""Formulas of skills: what they are, as text, and when they hold."""
