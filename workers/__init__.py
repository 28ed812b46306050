"""Robot workers: skills, the robots that carry them out, and the process that takes orders.

from workers import ParameterKind, SkillContext, SkillFailed, skill
"""

from typing import TYPE_CHECKING

from keyexpr_schema.lazy import lazy_names

if TYPE_CHECKING:
    from workers.context import SkillContext as SkillContext
    from workers.embodiment import Embodiment as Embodiment
    from workers.embodiment import EmbodimentFactory as EmbodimentFactory
    from workers.errors import BadArguments as BadArguments
    from workers.errors import BadSkill as BadSkill
    from workers.errors import JournalBusy as JournalBusy
    from workers.errors import JournalUnreadable as JournalUnreadable
    from workers.errors import RobotTaken as RobotTaken
    from workers.errors import RobotUnreachable as RobotUnreachable
    from workers.errors import SkillFailed as SkillFailed
    from workers.errors import UnknownSkill as UnknownSkill
    from workers.errors import WorkerError as WorkerError
    from workers.process import run_worker as run_worker
    from workers.skill_registry import ParameterKind as ParameterKind
    from workers.skill_registry import Skill as Skill
    from workers.skill_registry import SkillRegistry as SkillRegistry
    from workers.skill_registry import skill as skill
    from workers.skills.household import HOUSEHOLD as HOUSEHOLD
    from workers.world_cache import WorldCache as WorldCache
else:
    __all__, __getattr__ = lazy_names(
        __name__,
        {
            "context": "SkillContext",
            "embodiment": "Embodiment EmbodimentFactory",
            "errors": (
                "BadArguments BadSkill JournalBusy JournalUnreadable RobotTaken "
                "RobotUnreachable SkillFailed UnknownSkill WorkerError"
            ),
            "process": "run_worker",
            "skill_registry": "ParameterKind Skill SkillRegistry skill",
            "skills.household": "HOUSEHOLD",
            "world_cache": "WorldCache",
        },
    )
