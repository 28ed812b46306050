"""Errors of the timeline: each is one sentence for a person."""

from __future__ import annotations


class TimelineError(Exception):
    """Root of every error this package raises."""


class UnreadableRecording(TimelineError):
    """A file is not there, or is not a Rerun recording."""


class UnwritableRecording(TimelineError):
    """A recording cannot be written where it was asked for."""


class NoPicture(TimelineError):
    """The viewer could not draw: its program, a graphics driver or a screen is missing."""
