"""Robot workers: skills, the robots that carry them out, and the process that takes orders.

from workers import ParameterKind, SkillContext, SkillFailed, skill
"""

from typing import TYPE_CHECKING

from keyexpr_schema.lazy import lazy_names

if TYPE_CHECKING:
    from workers.embodiment import *  # noqa: F403
    from workers.errors import *  # noqa: F403
    from workers.orders.journal import *  # noqa: F403
    from workers.process import *  # noqa: F403
    from workers.skill_context import *  # noqa: F403
    from workers.skill_registry import *  # noqa: F403
    from workers.skills.household import *  # noqa: F403
    from workers.world_cache import *  # noqa: F403
else:
    __all__, __getattr__, __dir__ = lazy_names(
        __name__,
        {
            "skill_context": "SkillContext",
            "embodiment": "Embodiment EmbodimentFactory SensingEmbodiment YieldingEmbodiment",
            "errors": (
                "BadArguments BadSkill JournalBusy JournalUnreadable ProgramRefused "
                "ProgramStopped RobotTaken RobotUnreachable SkillFailed UnknownSkill "
                "WorkerError WorkersEnded"
            ),
            "orders.journal": "Retention",
            "process": "run_worker run_workers",
            "skill_registry": "ParameterKind Skill SkillRegistry skill",
            "skills.household": "HOUSEHOLD",
            "world_cache": "WorldCache",
        },
    )
