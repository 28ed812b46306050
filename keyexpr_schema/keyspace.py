"""The key-space: every key, once.

The realm (a site or a tenant) is not part of any key: it is the Zenoh session's `namespace`, so two
fleets share routers without seeing each other.
"""

from __future__ import annotations

from typing import Any

from keyexpr_schema.errors import ForeignKey
from keyexpr_schema.key import Kept, Key
from keyexpr_schema.payloads import (
    durations,
    goals,
    motions,
    plans,
    requests,
    robots,
    service,
    simulation,
    tasks,
    world,
)

# fmt: off
# --- goals ---------------------------------------------------------------------------------------
GOAL_SPEC = Key(
    "goal_spec", "goals/{goal}/spec",
    goals.GoalAddress, goals.Goal,
    "anyone", "planner, robotctl, recorder", Kept.STORED,
    "What someone wants, in words and as conditions.",
)
GOAL_STATUS = Key(
    "goal_status", "goals/{goal}/status",
    goals.GoalAddress, goals.GoalStatus,
    "planner", "robotctl, recorder", Kept.STORED,
    "How the goal stands, what it was understood to mean, and why not where it failed.",
)

# --- world ---------------------------------------------------------------------------------------
FACT = Key(
    "fact", "world/facts/{subject}/{relation}",
    world.FactAddress, world.Fact,
    "robots, people, planner", "planner, workers, robotctl", Kept.STORED,
    "One state variable, its value, who said so and when; the latest word holds.",
)
STATEMENT = Key(
    "statement", "world/statements/{statement}",
    world.StatementAddress, world.Statement,
    "people", "planner, robotctl", Kept.STORED,
    "A sentence about the world; the planner reads facts out of it where it can.",
)
STATEMENT_STATUS = Key(
    "statement_status", "world/statements/{statement}/status",
    world.StatementAddress, world.StatementStatus,
    "planner", "robotctl", Kept.STORED,
    "The facts that the planner read out of a statement, or why it read none.",
)
PLACE = Key(
    "place", "world/places/{place}",
    world.PlaceAddress, world.Place,
    "people", "planner, workers, robotctl, recorder", Kept.STORED,
    "A named region of the floor, its surfaces and its distances to other places.",
)
OBJECT = Key(
    "object", "world/objects/{object}",
    world.ObjectAddress, world.Object,
    "people", "planner, workers, robotctl", Kept.STORED,
    "A thing that can be spoken about; where it is, is a fact.",
)

# --- robots --------------------------------------------------------------------------------------
ROBOT_SPEC = Key(
    "robot_spec", "robots/{robot}/spec",
    robots.RobotAddress, robots.RobotSpec,
    "whoever registers the robot", "planner, its worker, robotctl, recorder", Kept.STORED,
    "What the robot is and can do.",
)
ROBOT_STATE = Key(
    "robot_state", "robots/{robot}/state",
    robots.RobotAddress, robots.RobotState,
    "its worker", "planner, other workers, robotctl, recorder", Kept.LATEST,
    "Where the robot is, what it holds, what it is doing.",
)
ROBOT_ALIVE = Key(
    "robot_alive", "robots/{robot}/alive/{incarnation}",
    robots.AliveAddress, robots.Alive,
    "its worker", "planner, robotctl", Kept.TOKEN,
    "There while that run of the robot's worker is connected.",
)
ORDER = Key(
    "order", "robots/{robot}/orders/{plan}/{task}",
    tasks.OrderAddress, tasks.Order,
    "planner", "that robot's worker, recorder", Kept.STORED,
    "A task given to a robot: revision, attempt, epoch, deadline.",
)
REPORT = Key(
    "report", "robots/{robot}/reports/{plan}/{task}/{attempt}",
    tasks.ReportAddress, tasks.Report,
    "that robot's worker", "planner, recorder", Kept.STORED,
    "What became of one attempt: every try with its reason, and the facts learned.",
)

DURATIONS = Key(
    "durations", "durations/{model}",
    durations.DurationsAddress, durations.Durations,
    "planner", "planner, robotctl", Kept.STORED,
    "How long a type of robot really takes, learned from its reports.",
)

# --- plans ---------------------------------------------------------------------------------------
PLAN_SPEC = Key(
    "plan_spec", "plans/{plan}/spec",
    plans.PlanAddress, plans.Plan,
    "planner; people may propose", "planner, robotctl, recorder", Kept.STORED,
    "Goals, tasks, dependencies and actors: a DAG.",
)
PLAN_STATUS = Key(
    "plan_status", "plans/{plan}/status",
    plans.PlanAddress, plans.PlanStatus,
    "planner", "robotctl, recorder", Kept.STORED,
    "Revision, allocation, how the plan stands, and why not where it failed.",
)
TASK_RECORD = Key(
    "task_record", "plans/{plan}/tasks/{task}",
    tasks.TaskAddress, tasks.TaskRecord,
    "planner", "robotctl, recorder", Kept.STORED,
    "The planner's record of one task: state, robot, attempts, times, reasons.",
)

# --- requests ------------------------------------------------------------------------------------
PLAN_REQUEST = Key(
    "plan_request", "requests/plan/{request}",
    requests.RequestAddress, requests.PlanRequest,
    "robotctl", "planner", Kept.STORED,
    "Make a plan.",
)
REPLAN_REQUEST = Key(
    "replan_request", "requests/replan/{request}",
    requests.RequestAddress, requests.ReplanRequest,
    "robotctl, robots", "planner", Kept.STORED,
    "Plan again from what is known now.",
)
CONTROL_REQUEST = Key(
    "control_request", "requests/control/{request}",
    requests.RequestAddress, requests.ControlRequest,
    "robotctl", "planner", Kept.STORED,
    "Start, cancel or delete a plan; add a task to one.",
)
ANSWER = Key(
    "answer", "answers/{request}",
    requests.RequestAddress, requests.Answer,
    "planner", "robotctl", Kept.STORED,
    "What became of a request, in a sentence.",
)

# --- the system itself ---------------------------------------------------------------------------
PLANNER_STATUS = Key(
    "planner_status", "planner/status",
    service.PlannerAddress, service.PlannerStatus,
    "planner", "planner, workers, robotctl", Kept.STORED,
    "Which run of the planner is in charge, and what it can do.",
)
PLANNER_ALIVE = Key(
    "planner_alive", "planner/alive/{incarnation}",
    service.PlannerAliveAddress, robots.Alive,
    "planner", "robotctl", Kept.TOKEN,
    "There while that run of the planner is connected.",
)
REJECT = Key(
    "reject", "rejects/{component}/{digest}",
    service.RejectAddress, service.Reject,
    "whoever could not read the value", "robotctl, recorder", Kept.STORED,
    "A value that is not what its key promises: which key, why, how often.",
)
STORE_JOURNAL = Key(
    "store_journal", "store/journal",
    service.StoreAddress, service.StoreQuery,
    "robotctl asks", "store answers", Kept.QUERY,
    "What changed in the key-space, in the order in which the store applied it.",
    reply=service.StoreJournal,
)

# --- the simulated world -------------------------------------------------------------------------
SIM_MOTION = Key(
    "sim_motion", "sim/robots/{robot}/motion",
    simulation.SimRobotAddress, simulation.MotionCall,
    "that robot's worker asks", "sim answers", Kept.QUERY,
    "Drives one simulated robot, as a robot's driver would be driven.",
    reply=motions.MotionOutcome,
)
SIM_SENSES = Key(
    "sim_senses", "sim/robots/{robot}/senses",
    simulation.SimRobotAddress, motions.Senses,
    "sim", "that robot's worker", Kept.STREAM,
    "Odometry, hand and basket sensors of one simulated robot.",
)
SIM_CLOCK = Key(
    "sim_clock", "sim/clock",
    simulation.SimAddress, simulation.SimClock,
    "sim", "planner, workers, recorder, robotctl", Kept.STREAM,
    "Simulated time.",
)
SIM_FRAMES = Key(
    "sim_frames", "sim/frames",
    simulation.SimAddress, simulation.Frames,
    "sim", "recorder", Kept.SEQUENCE,
    "Where every movable body was, ten times in a simulated second.",
)
SIM_SCENE = Key(
    "sim_scene", "sim/scene",
    simulation.SimAddress, simulation.Scene,
    "sim", "recorder", Kept.STORED,
    "The shapes of every body, and where the fixed ones stand.",
)
SIM_TRUTH = Key(
    "sim_truth", "sim/truth/{object}",
    simulation.TruthAddress, simulation.Truth,
    "sim", "recorder, the judge in robotctl demo; never the planner", Kept.LATEST,
    "Where an object really is.",
)
SIM_CONTACTS = Key(
    "sim_contacts", "sim/contacts",
    simulation.SimAddress, simulation.ContactCount,
    "sim", "the judge in robotctl demo", Kept.LATEST,
    "How often robots ran into each other or into walls.",
)

# fmt: on
KEYSPACE: tuple[Key[Any, Any], ...] = tuple(
    value for value in list(globals().values()) if isinstance(value, Key)
)
"""Every key, in the order of this file."""


def key_of(keyexpr: str) -> Key[Any, Any]:
    """The row of the table that a key expression without wildcards belongs to.

    Raises:
        ForeignKey: it belongs to none.
    """
    for key in KEYSPACE:
        try:
            key.parse(keyexpr)
        except ForeignKey:
            continue
        return key
    raise ForeignKey(f"{keyexpr!r} is not a key of this system; docs/keyspace.md lists them")
