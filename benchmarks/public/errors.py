"""What can be wrong with a public set's files, and with a step in its world."""


class BadTaskFile(ValueError):
    """A file is not as the set's are; the message says which, where and what would be right."""


class IllegalStep(ValueError):
    """A step that the set's rules do not allow now."""
