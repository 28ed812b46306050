"""The key-space: every key, once.

The realm (a site or a tenant) is not part of any key: it is the Zenoh session's `namespace`, so two
fleets share routers without seeing each other.
"""

from __future__ import annotations

from typing import Any

from keyexpr_schema.key import Component, Delivery, Key, KeyTree
from keyexpr_schema.payloads import (
    audit,
    closures,
    deployments,
    durations,
    goals,
    history,
    holds,
    leases,
    methods,
    motions,
    plans,
    questions,
    requests,
    robots,
    schedules,
    simulation,
    stops,
    system,
    tasks,
    world,
)

PERSON, PLANNER, WORKER, OWN_WORKER, SIMULATION, RECORDER, STORE = Component
ANYONE = Component.ANYONE
STORED, LATEST, STREAM, SEQUENCE, TOKEN, QUERY = Delivery

# fmt: off
# --- goals ---------------------------------------------------------------------------------------
GOAL_SPEC = Key(
    "goal_spec", "goals/{goal}/spec", goals.GoalAddress, goals.Goal,
    delivery=STORED, writers=PERSON, readers=PLANNER | PERSON | RECORDER,
    put_back=True,
    about="What someone wants, in words and as conditions.",
)
GOAL_STATUS = Key(
    "goal_status", "goals/{goal}/status", goals.GoalAddress, goals.GoalStatus,
    delivery=STORED, writers=PLANNER, readers=PLANNER | PERSON | RECORDER,
    about="How the goal stands, what it was understood to mean, and why not where it failed.",
)

# --- schedules -----------------------------------------------------------------------------------
SCHEDULE_SPEC = Key(
    "schedule_spec", "schedules/{schedule}/spec", schedules.ScheduleAddress, schedules.Schedule,
    delivery=STORED, writers=PERSON, readers=PLANNER | PERSON,
    put_back=True,
    about="What is wanted again and again, and when; each run is a goal of its own.",
)
SCHEDULE_STATUS = Key(
    "schedule_status", "schedules/{schedule}/status",
    schedules.ScheduleAddress, schedules.ScheduleStatus,
    delivery=STORED, writers=PLANNER, readers=PLANNER | PERSON,
    about="When a schedule's next run begins, and what became of the ones before.",
)

# --- world ---------------------------------------------------------------------------------------
FACT = Key(
    "fact", "world/facts/{subject}/{relation}", world.FactAddress, world.Fact,
    delivery=STORED, by_receipt=True, writers=PERSON | PLANNER | WORKER,
    readers=PLANNER | WORKER | PERSON | RECORDER,
    put_back=True,
    about="One state variable, its value, who said so and when; the word received last holds.",
)
STATEMENT = Key(
    "statement", "world/statements/{statement}", world.StatementAddress, world.Statement,
    delivery=STORED, by_receipt=True, writers=PERSON, readers=PLANNER | PERSON,
    put_back=True,
    about="A sentence about the world; the planner reads facts out of it where it can.",
)
STATEMENT_STATUS = Key(
    "statement_status", "world/statements/{statement}/status",
    world.StatementAddress, world.StatementStatus,
    delivery=STORED, writers=PLANNER, readers=PLANNER | PERSON,
    about="The facts that the planner read out of a statement, or why it read none.",
)
PLACE = Key(
    "place", "world/places/{place}", world.PlaceAddress, world.Place,
    delivery=STORED, writers=PERSON, readers=PLANNER | WORKER | PERSON | RECORDER,
    put_back=True,
    about="A named region of the floor, its surfaces and its distances to other places.",
)
OBJECT = Key(
    "object", "world/objects/{object}", world.ObjectAddress, world.Object,
    delivery=STORED, writers=PERSON, readers=PLANNER | WORKER | PERSON,
    put_back=True,
    about="A thing that can be spoken about; where it is, is a fact.",
)

REGION = Key(
    "region", "world/regions/{region}", closures.RegionAddress, closures.Region,
    delivery=STORED, writers=PERSON, readers=PERSON,
    about="A door, or a zone: a part of the floor that can be closed.",
)
CLAIM = Key(
    "claim", "world/claims/{of}/{name}", world.ClaimAddress, world.Claim,
    delivery=STORED, writers=PERSON, readers=PERSON,
    about="Which number or name is being given: two people at once do not get the same one.",
)

# --- robots --------------------------------------------------------------------------------------
ROBOT_SPEC = Key(
    "robot_spec", "robots/{robot}/spec", robots.RobotAddress, robots.RobotSpec,
    delivery=STORED, writers=PERSON, readers=PLANNER | WORKER | PERSON | RECORDER,
    put_back=True,
    about="What the robot is and can do.",
)
ROBOT_STATE = Key(
    "robot_state", "robots/{robot}/state", robots.RobotAddress, robots.RobotState,
    delivery=LATEST, writers=OWN_WORKER | PERSON, readers=WORKER | PERSON | RECORDER,
    about="Where the robot is, what it holds, what it is doing.",
)
ROBOT_ALIVE = Key(
    "robot_alive", "robots/{robot}/alive/{incarnation}", robots.AliveAddress, robots.Alive,
    delivery=TOKEN, writers=OWN_WORKER, readers=PLANNER | OWN_WORKER | PERSON,
    about="There while that run of the robot's worker is connected.",
)
ORDER = Key(
    "order", "robots/{robot}/orders/{plan}/{task}", tasks.OrderAddress, tasks.Order,
    delivery=STORED, writers=PLANNER, readers=PLANNER | OWN_WORKER | PERSON | RECORDER,
    about="A task given to a robot: revision, attempt, epoch, deadline.",
)
REPORT = Key(
    "report", "robots/{robot}/reports/{plan}/{task}/{attempt}", tasks.ReportAddress, tasks.Report,
    delivery=STORED, by_receipt=True,
    writers=OWN_WORKER, readers=PLANNER | OWN_WORKER | PERSON | RECORDER,
    about="What became of one attempt: every try with its reason, and the facts learned.",
)

DEPLOYMENT = Key(
    "deployment", "robots/{robot}/deployment", robots.RobotAddress, deployments.Deployment,
    delivery=STORED, writers=PERSON, readers=PERSON,
    about="Where a robot's worker was put as a container, by whom; gone when it was taken away.",
)

# --- holds ---------------------------------------------------------------------------------------
HOLD = Key(
    "hold", "holds/{hold}", holds.HoldAddress, holds.Hold,
    delivery=STORED, writers=PERSON, readers=PLANNER | PERSON | RECORDER,
    put_back=True,
    about="A pause of robots, plans or the fleet, or a drain of robots, until the key is deleted.",
)

# --- closures ------------------------------------------------------------------------------------
CLOSURE = Key(
    "closure", "closures/{closure}", closures.ClosureAddress, closures.Closure,
    delivery=STORED, writers=PERSON, readers=PLANNER | SIMULATION | PERSON | RECORDER,
    put_back=True,
    about="Where robots do not drive, or one at a time, until it is deleted or its time is over.",
)

# --- stops ---------------------------------------------------------------------------------------
STOP = Key(
    "stop", "stops/{stop}", stops.StopAddress, stops.Stop,
    delivery=STORED, writers=PERSON, readers=PLANNER | WORKER | SIMULATION | PERSON | RECORDER,
    put_back=True,
    about="An emergency stop: whoever drives a robot obeys it, until the key is deleted.",
)
STOP_RELEASE = Key(
    "stop_release", "stops/{stop}/released/{robot}", stops.StopReleaseAddress, stops.StopRelease,
    delivery=STORED, writers=PERSON, readers=PLANNER | WORKER | SIMULATION | PERSON | RECORDER,
    put_back=True,
    about="A robot that may move again, though the stop goes on for others.",
)

DURATIONS = Key(
    "durations", "durations/{model}", durations.DurationsAddress, durations.Durations,
    delivery=STORED, writers=PLANNER, readers=PLANNER | PERSON,
    about="How long a type of robot really takes, learned from its reports.",
)

# --- plans ---------------------------------------------------------------------------------------
PLAN_SPEC = Key(
    "plan_spec", "plans/{plan}/spec", plans.PlanAddress, plans.Plan,
    delivery=STORED, writers=PLANNER, readers=PLANNER | PERSON | RECORDER,
    about="Goals, tasks, dependencies and actors: a DAG.",
)
PLAN_PROPOSAL = Key(
    "plan_proposal", "plans/{plan}/proposal", plans.PlanAddress, plans.Plan,
    delivery=STORED, writers=PERSON, readers=PLANNER | PERSON,
    about="A plan that somebody wants checked, allocated and carried out.",
)
PLAN_STATUS = Key(
    "plan_status", "plans/{plan}/status", plans.PlanAddress, plans.PlanStatus,
    delivery=STORED, writers=PLANNER, readers=PLANNER | PERSON | RECORDER,
    about="Revision, allocation, how the plan stands, and why not where it failed.",
)
TASK_RECORD = Key(
    "task_record", "plans/{plan}/tasks/{task}", tasks.TaskAddress, tasks.TaskRecord,
    delivery=STORED, writers=PLANNER, readers=PLANNER | PERSON | RECORDER,
    about="The planner's record of one task: state, robot, attempts, times, reasons.",
)

# --- requests ------------------------------------------------------------------------------------
PLAN_REQUEST = Key(
    "plan_request", "requests/plan/{request}", requests.RequestAddress, requests.PlanRequest,
    delivery=STORED, writers=PERSON, readers=PLANNER,
    about="Make a plan.",
)
REPLAN_REQUEST = Key(
    "replan_request", "requests/replan/{request}", requests.RequestAddress, requests.ReplanRequest,
    delivery=STORED, writers=PERSON, readers=PLANNER,
    about="Plan again from what is known now.",
)
CONTROL_REQUEST = Key(
    "control_request", "requests/control/{request}",
    requests.RequestAddress, requests.ControlRequest,
    delivery=STORED, writers=PERSON, readers=PLANNER,
    about="Start, cancel or delete a plan; add a task to one.",
)
ANSWER = Key(
    "answer", "answers/{request}", requests.RequestAddress, requests.Answer,
    delivery=STORED, writers=PLANNER, readers=PLANNER | PERSON,
    about="What became of a request, in a sentence.",
)

# --- the system itself ---------------------------------------------------------------------------
PLANNER_STATUS = Key(
    "planner_status", "planner/status", system.PlannerAddress, system.PlannerStatus,
    delivery=STORED, writers=PLANNER, readers=PLANNER | PERSON,
    about="Which run of the planner is in charge, and what it can do.",
)
PLANNER_ALIVE = Key(
    "planner_alive", "planner/alive/{incarnation}", system.PlannerAliveAddress, robots.Alive,
    delivery=TOKEN, writers=PLANNER, readers=PLANNER | PERSON,
    about="There while that run of the planner is connected.",
)
RECORDER_ALIVE = Key(
    "recorder_alive", "recorder/alive/{incarnation}", system.RecorderAliveAddress, robots.Alive,
    delivery=TOKEN, writers=RECORDER, readers=RECORDER | PERSON,
    about="There while that run of a recorder is connected.",
)
UNDECODABLE = Key(
    "reject", "rejects/{component}/{digest}", system.UndecodableAddress, system.UndecodableValue,
    delivery=STORED, writers=ANYONE, readers=PERSON | RECORDER,
    about="A value that is not what its key promises: which key, why, how often.",
)
LEASE = Key(
    "lease", "planner/lease", system.PlannerAddress, leases.LeaseQuery,
    delivery=QUERY, writers=WORKER | PLANNER | PERSON, readers=PLANNER,
    about="For how long robots may move without asking again; of none: whether it answers.",
    reply=leases.LeaseGrant,
)
DIAGNOSTIC = Key(
    "diagnostic", "diagnostics/{component}/{check}", system.DiagnosticAddress, system.Diagnostic,
    delivery=STORED, writers=PLANNER | RECORDER, readers=PLANNER | PERSON | RECORDER,
    about="What is wrong with a component now; nothing there means that all is well.",
)
DELETION = Key(
    "deletion", "deletions/{deletion}", audit.DeletionAddress, audit.Deletion,
    delivery=STORED, writers=PERSON, readers=PLANNER,
    about="Who is about to delete a key; gone once that stands in the audit log.",
)
AUDIT = Key(
    "audit", "planner/audit", system.PlannerAddress, audit.AuditQuery,
    delivery=QUERY, writers=PERSON, readers=PLANNER,
    about="Who did what: all that people have put and deleted.",
    reply=audit.AuditPage,
)
HISTORY = Key(
    "history", "planner/history", system.PlannerAddress, history.HistoryQuery,
    delivery=QUERY, writers=PERSON, readers=PLANNER,
    about="What is over: what was wanted, what came of it, who did it, how long it took.",
    reply=history.HistoryPage,
)
HISTORY_STATS = Key(
    "history_stats", "planner/history/stats", system.PlannerAddress, history.HistoryStatsQuery,
    delivery=QUERY, writers=PERSON, readers=PLANNER,
    about="The history, added up by day.",
    reply=history.HistoryStats,
)
RETIREMENT = Key(
    "retirement", "planner/retirement", system.PlannerAddress, history.RetireQuery,
    delivery=QUERY, writers=PERSON, readers=PLANNER,
    about="Deletes the keys of what is over at once; the history keeps it.",
    reply=history.Retired,
)
QUESTION = Key(
    "question", "planner/question", system.PlannerAddress, questions.QuestionQuery,
    delivery=QUERY, writers=PERSON, readers=PLANNER,
    about="A question in words, answered from what is believed.",
    reply=questions.QuestionReply,
)
TASKS_KNOWN = Key(
    "tasks_known", "planner/tasks", system.PlannerAddress, methods.TasksQuery,
    delivery=QUERY, writers=PERSON, readers=PLANNER,
    about="Which tasks goals can call by name; what a text that does so would mean now.",
    reply=methods.TasksReply,
)
REVOCATIONS = Key(
    "revocations", "certificates/revoked/{authority}", system.AuthorityAddress, system.Revocations,
    delivery=STORED, writers=PERSON, readers=ANYONE,
    about="Which certificates nobody is to believe any more; their authority has signed the list.",
)
STORE_ALIVE = Key(
    "store_alive", "store/alive/{incarnation}", system.StoreAliveAddress, robots.Alive,
    delivery=TOKEN, writers=STORE, readers=STORE,
    about="There while a router's store is: of linked routers one has a store. Beside all realms.",
)
STORE_JOURNAL = Key(
    "store_journal", "store/journal", system.StoreAddress, system.StoreQuery,
    delivery=QUERY, writers=ANYONE, readers=STORE,
    about="What changed in the key-space, in the order in which the store applied it.",
    reply=system.StoreJournal,
)
STORE_STAMPS = Key(
    "store_stamps", "store/stamps", system.StoreAddress, system.StoreStampsQuery,
    delivery=QUERY, writers=ANYONE, readers=STORE,
    about="Whether writes have arrived and are on disk: the timestamp that each key holds.",
    reply=system.StoreStamps,
)
STORE_REPLACE = Key(
    "store_replace", "store/replace/{asker}", system.StoreAskerAddress, system.StoreReplaceQuery,
    delivery=QUERY, writers=ANYONE, readers=STORE,
    about="Compare and set: writes a key for who may, unless it was written since it was seen.",
    reply=system.StoreReplaced,
)
STORE_CLOCK = Key(
    "store_clock", "store/clock", system.StoreAddress, system.StoreClockQuery,
    delivery=QUERY, writers=ANYONE, readers=STORE,
    about="What time it is on the store's host, by which clocks are compared.",
    reply=system.StoreClock,
)
STORE_CHANGES = Key(
    "store_changes", "store/changes", system.StoreAddress, system.StoreChangesQuery,
    delivery=QUERY, writers=ANYONE, readers=STORE,
    about="What the keys of some patterns hold now, page by page; later, what changed since.",
    reply=system.StoreChanges,
)

# --- the simulated world -------------------------------------------------------------------------
SIM_MOTION = Key(
    "sim_motion", "sim/robots/{robot}/motion", simulation.SimRobotAddress, simulation.MotionCall,
    delivery=QUERY, writers=OWN_WORKER, readers=SIMULATION,
    about="Drives one simulated robot, as a robot's driver would be driven.",
    reply=motions.MotionOutcome,
)
SIM_SENSES = Key(
    "sim_senses", "sim/robots/{robot}/senses", simulation.SimRobotAddress, motions.Senses,
    delivery=STREAM, writers=SIMULATION, readers=OWN_WORKER | PERSON,
    about="Odometry, hand and basket sensors of one simulated robot.",
)
SIM_ALIVE = Key(
    "sim_alive", "sim/alive/{incarnation}", simulation.SimAliveAddress, robots.Alive,
    delivery=TOKEN, writers=SIMULATION, readers=SIMULATION | PERSON,
    about="There while that run of the simulated world is connected: there is one to a realm.",
)
SIM_CLOCK = Key(
    "sim_clock", "sim/clock", simulation.SimAddress, simulation.SimClock,
    delivery=STREAM, writers=SIMULATION, readers=PLANNER | WORKER | PERSON | RECORDER,
    about="Simulated time.",
)
SIM_FRAMES = Key(
    "sim_frames", "sim/frames", simulation.SimAddress, simulation.Frames,
    delivery=SEQUENCE, writers=SIMULATION, readers=RECORDER,
    about="Where every movable body was, ten times in a simulated second.",
)
SIM_SCENE = Key(
    "sim_scene", "sim/scene", simulation.SimAddress, simulation.Scene,
    delivery=STORED, writers=SIMULATION, readers=PLANNER | PERSON | RECORDER,
    about="The shapes of every body, and where the fixed ones stand.",
)
SIM_TRUTH = Key(
    "sim_truth", "sim/truth/{object}", simulation.TruthAddress, simulation.Truth,
    delivery=LATEST, writers=SIMULATION, readers=PERSON | RECORDER,
    about="Where an object really is.",
)
SIM_CONTACTS = Key(
    "sim_contacts", "sim/contacts", simulation.SimAddress, simulation.ContactCount,
    delivery=LATEST, writers=SIMULATION, readers=PERSON,
    about="How often robots ran into each other or into walls.",
)

# fmt: on
KEYSPACE: tuple[Key[Any, Any], ...] = tuple(
    value for value in list(globals().values()) if isinstance(value, Key)
)
"""Every key, in the order of this file."""

PLAN_TREE = KeyTree("plans/{plan}/**", (PLAN_SPEC, PLAN_PROPOSAL, PLAN_STATUS, TASK_RECORD))
REPORT_TREE = KeyTree("robots/*/reports/{plan}/**", (REPORT,))
GOAL_TREE = KeyTree("goals/{goal}/*", (GOAL_SPEC, GOAL_STATUS))
REQUEST_TREE = KeyTree("requests/*/{request}", (PLAN_REQUEST, REPLAN_REQUEST, CONTROL_REQUEST))
ANSWER_TREE = KeyTree("answers/{request}", (ANSWER,))
DELETION_TREE = KeyTree("deletions/{deletion}", (DELETION,))
CLOSURE_TREE = KeyTree("closures/{closure}", (CLOSURE,))
KEY_TREES = (
    PLAN_TREE, REPORT_TREE, GOAL_TREE, REQUEST_TREE, ANSWER_TREE, DELETION_TREE, CLOSURE_TREE,
)  # fmt: skip
"""What the planner deletes, whoever wrote it, when what it is about has been over for long."""
