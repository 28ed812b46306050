"""The contract of the fleet: every key, its payload, who writes it, who reads it; and a session.

    from keyexpr_schema import GOAL_SPEC, Goal, GoalAddress, SessionConfig, open_session

Everything is imported when it is first asked for, so that a program which wants an identifier
checked does not load Zenoh.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from keyexpr_schema.lazy import lazy_names

if TYPE_CHECKING:
    from keyexpr_schema.errors import *  # noqa: F403
    from keyexpr_schema.facts import *  # noqa: F403
    from keyexpr_schema.ids import *  # noqa: F403
    from keyexpr_schema.key import *  # noqa: F403
    from keyexpr_schema.key_lookup import *  # noqa: F403
    from keyexpr_schema.keyspace import *  # noqa: F403
    from keyexpr_schema.payloads.durations import *  # noqa: F403
    from keyexpr_schema.payloads.goals import *  # noqa: F403
    from keyexpr_schema.payloads.motions import *  # noqa: F403
    from keyexpr_schema.payloads.plans import *  # noqa: F403
    from keyexpr_schema.payloads.programs import *  # noqa: F403
    from keyexpr_schema.payloads.requests import *  # noqa: F403
    from keyexpr_schema.payloads.robots import *  # noqa: F403
    from keyexpr_schema.payloads.simulation import *  # noqa: F403
    from keyexpr_schema.payloads.system import *  # noqa: F403
    from keyexpr_schema.payloads.tasks import *  # noqa: F403
    from keyexpr_schema.payloads.waits import *  # noqa: F403
    from keyexpr_schema.payloads.world import *  # noqa: F403
    from keyexpr_schema.transport.router import *  # noqa: F403
    from keyexpr_schema.transport.session import *  # noqa: F403
else:
    __all__, __getattr__, __dir__ = lazy_names(
        __name__,
        {
            "errors": (
                "BadEndpoint CannotListen SchemaError ForeignKey InvalidId NoReply NoConfigFile "
                "Overtaken Unconfirmed "
                "UndecodablePayload Unreachable"
            ),
            "facts": (
                "AT BLOCKED_BY CHARGE HELD HOLDING IN IS_OPEN LOCATED NOTHING ON REACHABLE "
                "SEARCHED FactKey Literal Value parse_literal parse_value render_value"
            ),
            "ids": "Id actor_arg check_id slug",
            "key": "Address Component Delivery Key Payload",
            "key_lookup": "key_of",
            "keyspace": (
                "GOAL_SPEC GOAL_STATUS FACT STATEMENT STATEMENT_STATUS PLACE OBJECT CLAIM "
                "ROBOT_SPEC ROBOT_STATE ROBOT_ALIVE ORDER REPORT DURATIONS PLAN_SPEC PLAN_PROPOSAL "
                "PLAN_STATUS TASK_RECORD PLAN_REQUEST REPLAN_REQUEST CONTROL_REQUEST ANSWER "
                "PLANNER_STATUS PLANNER_ALIVE UNDECODABLE DIAGNOSTIC STORE_JOURNAL STORE_STAMPS "
                "STORE_REPLACE STORE_CHANGES "
                "SIM_MOTION SIM_SENSES SIM_ALIVE SIM_CLOCK SIM_FRAMES SIM_SCENE SIM_TRUTH "
                "SIM_CONTACTS KEYSPACE"
            ),
            "payloads.durations": "Durations DurationsAddress Estimate",
            "payloads.goals": "Condition ENDED_GOALS Goal GoalAddress GoalState GoalStatus",
            "payloads.motions": (
                "Detection Motion MotionKind MotionOutcome MotionState PointM Senses"
            ),
            "payloads.plans": (
                "ENDED_PLANS Making Plan PlanAddress PlanChange PlanState PlanStatus Task Violation"
            ),
            "payloads.programs": "DO Program ProgramCall ProgramEnd ProgramStep ProgramTrace",
            "payloads.requests": (
                "Answer Control ControlRequest PlanRequest ReplanRequest RequestAddress"
            ),
            "payloads.robots": (
                "Alive AliveAddress Battery PoseMRad RobotActivity RobotAddress RobotSpec "
                "RobotState"
            ),
            "payloads.system": (
                "Diagnostic DiagnosticAddress JournalEntry PlannerAddress PlannerAliveAddress "
                "PlannerStatus StoreAddress StoreChanges StoreChangesQuery StoreJournal "
                "StoreQuery StoreReplaced StoreReplaceQuery StoreStamps StoreStampsQuery "
                "StoredValue UndecodableAddress UndecodableValue"
            ),
            "payloads.simulation": (
                "Body ContactCount Frame Frames MotionCall QuaternionWxyz Scene Shape ShapeKind "
                "SimAddress SimClock SimRobotAddress Truth TruthAddress"
            ),
            "payloads.tasks": (
                "ENDED_TASKS FINAL_REPORTS Order OrderAddress Report ReportAddress ReportState "
                "TaskAddress TaskRecord TaskState Try"
            ),
            "payloads.waits": "WaitKind WaitReason",
            "payloads.world": (
                "Claim ClaimAddress Fact FactAddress Feature Object ObjectAddress Place "
                "PlaceAddress Statement StatementAddress StatementStatus Surface"
            ),
            "transport.router": "run_router",
            "transport.session": (
                "Change Session SessionConfig TokenChange TokenWatch Watch open_session"
            ),
        },
    )
