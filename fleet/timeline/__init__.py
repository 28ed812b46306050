"""The Rerun recorder: an observer of keys, nothing more.

Nothing here is imported by the rest of the fleet, and rerun (0.6 s) is imported only with the
modules that use it, so import them where they are needed.
"""
