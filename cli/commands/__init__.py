"""The commands of robotctl, one module a subject; each is imported only when it is called."""
