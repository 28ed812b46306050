"""Pictures of the documentation that are drawn from files of this repository."""
