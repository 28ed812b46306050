"""Robot workers: skills, the robots that carry them out, and the process that takes orders.

from workers import ParameterKind, SkillContext, SkillFailed, skill
"""

from workers.context import SkillContext
from workers.embodiment import Embodiment, EmbodimentFactory
from workers.errors import (
    BadArguments,
    BadSkill,
    JournalBusy,
    JournalUnreadable,
    RobotTaken,
    RobotUnreachable,
    SkillFailed,
    UnknownSkill,
    WorkerError,
)
from workers.process import run_worker
from workers.skill_registry import ParameterKind, Skill, SkillRegistry, skill
from workers.skills.household import HOUSEHOLD
from workers.world_cache import WorldCache

__all__ = [
    "BadArguments",
    "BadSkill",
    "Embodiment",
    "EmbodimentFactory",
    "HOUSEHOLD",
    "JournalBusy",
    "JournalUnreadable",
    "ParameterKind",
    "RobotTaken",
    "RobotUnreachable",
    "Skill",
    "SkillContext",
    "SkillFailed",
    "SkillRegistry",
    "UnknownSkill",
    "WorkerError",
    "WorldCache",
    "run_worker",
    "skill",
]
