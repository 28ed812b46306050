"""Colours: one a robot, one a skill, one a state. RGBA, 0 to 255."""

from __future__ import annotations

from keyexpr_schema.payloads.tasks import TaskState

Rgba = tuple[int, int, int, int]

# Okabe and Ito's colour-blind safe set, lightened for the viewer's dark background.
_ROBOTS: tuple[Rgba, ...] = (
    (86, 180, 233, 255),
    (240, 228, 66, 255),
    (230, 159, 0, 255),
    (0, 190, 140, 255),
    (214, 139, 185, 255),
    (240, 120, 70, 255),
    (150, 150, 255, 255),
    (170, 210, 110, 255),
)

_SKILLS: dict[str, Rgba] = {
    "navigate": (58, 110, 165, 255),
    "search": (126, 87, 160, 255),
    "pick": (190, 120, 20, 255),
    "place": (40, 130, 80, 255),
    "place_on_robot": (20, 135, 140, 255),
}
_OTHER_SKILLS: tuple[Rgba, ...] = (
    (160, 82, 120, 255),
    (110, 120, 45, 255),
    (140, 95, 70, 255),
    (85, 105, 185, 255),
    (95, 125, 125, 255),
)

FAILED: Rgba = (200, 45, 45, 255)
CANCELLED: Rgba = (95, 95, 95, 255)
STOPPED: Rgba = (120, 20, 20, 255)
PAUSED: Rgba = (70, 70, 40, 255)
DRAINED: Rgba = (60, 60, 75, 255)
CLOSED: Rgba = (150, 45, 45, 255)
ONE_AT_A_TIME: Rgba = (150, 120, 40, 255)
FLEET: Rgba = (245, 245, 245, 255)

WORDS: Rgba = (255, 215, 205, 255)
"""Of what is written on coloured floor."""
TITLE: Rgba = (235, 235, 235, 255)

TASK_STATES: dict[TaskState, Rgba] = {
    TaskState.WAITING: (150, 150, 150, 255),
    TaskState.ORDERED: (235, 200, 90, 255),
    TaskState.RUNNING: (80, 165, 255, 255),
    TaskState.SUCCEEDED: (85, 200, 110, 255),
    TaskState.FAILED: (240, 80, 80, 255),
    TaskState.CANCELLED: (110, 90, 90, 255),
}


class Palette:
    """Hands out colours in the order in which names are first asked for."""

    def __init__(self) -> None:
        self._robots: dict[str, Rgba] = {}
        self._skills: dict[str, Rgba] = {}

    def robot(self, robot: str) -> Rgba:
        """The colour of a robot; the same for as long as the palette lives."""
        return self._robots.setdefault(robot, _ROBOTS[len(self._robots) % len(_ROBOTS)])

    def skill(self, skill: str) -> Rgba:
        """The colour of a skill; the skills of the standard library always have the same."""
        known = _SKILLS.get(skill)
        if known is not None:
            return known
        return self._skills.setdefault(skill, _OTHER_SKILLS[len(self._skills) % len(_OTHER_SKILLS)])
