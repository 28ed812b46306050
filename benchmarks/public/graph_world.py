"""COHERENT's graphs as a world of this project, and plans as steps of the set.

Rooms are places; all else that is no robot is a thing that is `at` what it is on or in. What the
set's robots can do is in the skill file beside this module. What a dog is close to is kept in a few
variables of the dog, so the world says a little less than the graph: a dog is not known to be close
to all that it put down on the way, nor goes it up to what is on or in a thing that moves; nobody
uses the top of what is a container, too, and nobody reaches through what is closed.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from benchmarks.public.errors import BadTaskFile
from benchmarks.public.graph_rules import (
    CLOSES,
    GRAB,
    LAND_ON,
    MOVE,
    OPENS,
    PUT_INTO,
    PUT_ON,
    TAKE_OFF,
    Step,
)
from benchmarks.public.scene_graph import (
    AGENTS,
    CONTAINERS,
    DOOR,
    FLOOR,
    GRABABLE,
    HIGH_HEIGHT,
    INSIDE,
    LANDABLE,
    LEADING_TO,
    ON,
    ON_HIGH_SURFACE,
    OPEN,
    OPEN_FOREVER,
    QUADROTOR,
    ROBOT_ARM,
    ROBOT_DOG,
    ROOMS,
    SURFACES,
    WITH,
    Node,
    Task,
)
from fleet.core.model.skills import Action
from fleet.core.model.world import WorldModel
from fleet.service.skill_models import load_skills
from keyexpr_schema.facts import AT, HOLDING, IN, IS_OPEN, NOTHING, Value
from keyexpr_schema.facts import ON as ON_THING
from keyexpr_schema.payloads.goals import Condition, Goal
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.world import Fact, Feature, Object, Place

SKILLS = load_skills(Path(__file__).with_name("coherent.yaml"))
_FLYING = ("take_off", "fly_over", "fly_through", "land")
_ARM = tuple(name for name in SKILLS if name.startswith("arm_"))
_SKILLS_OF = {
    QUADROTOR: _FLYING,
    ROBOT_ARM: _ARM,
    ROBOT_DOG: tuple(name for name in SKILLS if name not in (*_FLYING, *_ARM)),
}
_CAPABILITIES = {QUADROTOR: {"basket": 1.0}, ROBOT_ARM: {"grip": 1.0}, ROBOT_DOG: {"grip": 1.0}}
_STEPS = {
    "take_off": (TAKE_OFF, "surface"),
    "fly_over": (MOVE, "surface"),
    "fly_through": (MOVE, "to"),
    "land": (LAND_ON, "surface"),
    "go_through": (MOVE, "to"),
    "go_to_door": (MOVE, "door"),
    "go_to": (MOVE, "thing"),
    "go_to_inside": (MOVE, "thing"),
    "go_to_basket": (MOVE, "basket"),
    "go_to_load": (MOVE, "thing"),
    "open_door": (OPENS, "door"),
    "close_door": (CLOSES, "door"),
    "open": (OPENS, "thing"),
    "close": (CLOSES, "thing"),
    "take": (GRAB, "object"),
    "take_support": (GRAB, "object"),
    "take_again": (GRAB, "object"),
    "take_from": (GRAB, "object"),
    "take_out": (GRAB, "object"),
    "unload": (GRAB, "object"),
    "put_on": (PUT_ON, "object", "onto"),
    "put_in": (PUT_INTO, "object", "into"),
    "load": (PUT_INTO, "object", "basket"),
    "arm_open": (OPENS, "thing"),
    "arm_close": (CLOSES, "thing"),
    "arm_take": (GRAB, "object"),
    "arm_take_out": (GRAB, "object"),
    "arm_take_from": (GRAB, "object"),
    "arm_unload": (GRAB, "object"),
    "arm_put_on": (PUT_ON, "object", "onto"),
    "arm_put_in": (PUT_INTO, "object", "container"),
    "arm_put_on_top": (PUT_ON, "object", "onto"),
    "arm_put_inside": (PUT_INTO, "object", "into"),
    "arm_load": (PUT_INTO, "object", "basket"),
}
"""By skill: the step, and the parameters that it is with."""


def name_of(node: Node) -> str:
    """The name of a node in our world."""
    return f"{re.sub(r'[^a-z0-9]+', '_', node.class_name.lower()).strip('_')}_{node.id}"


def step_of(action: Action, task: Task) -> Step:
    """The step of the set that an action is."""
    ids = {name_of(node): node.id for node in task.nodes.values()}
    step, *parameters = _STEPS[action.skill.name]
    return Step(ids[action.actor], step, *(ids[action.args[name]] for name in parameters))


def goal_of(task: Task) -> Goal:
    """What is wanted, as conditions."""
    names = {node.id: name_of(node) for node in task.nodes.values()}
    conditions = []
    for of, relation, to in task.goal:
        flies = task.nodes[of].class_name == QUADROTOR
        known = "stands_on" if flies else ON_THING if relation == ON else IN
        conditions.append(Condition(relation=known, subject=names[of], value=names[to]))
    return Goal(goal=task.name, text="", conditions=tuple(conditions))


def world_of(task: Task) -> WorldModel:
    """The world that a task begins in.

    Raises:
        BadTaskFile: something in it cannot be said in our world.
    """
    nodes = task.nodes.values()
    return WorldModel.of(
        SKILLS,
        [Place(place=name_of(n), label=n.class_name) for n in nodes if n.category == ROOMS],
        [*(_thing(n, task) for n in nodes if _is_thing(n)), *_ways(task)],
        [_robot(n, task) for n in nodes if n.category == AGENTS],
        [
            Fact(subject=subject, relation=relation, value=value, source="benchmark")
            for relation, subject, value in _facts(task)
        ],
    )


def _is_thing(node: Node) -> bool:
    return node.category not in (ROOMS, AGENTS)


def _thing(node: Node, task: Task) -> Object:
    floor, door = node.category == FLOOR, node.class_name == DOOR
    is_basket = any(e.to == node.id and e.relation == WITH for e in task.edges)
    movable = GRABABLE in node.properties
    features = {
        Feature.SUPPORTS.value: SURFACES in node.properties and CONTAINERS not in node.properties,
        Feature.CONTAINS.value: CONTAINERS in node.properties,
        Feature.OPENABLE.value: door or (_opens(node) and OPEN_FOREVER not in node.states),
        "closable": _opens(node) and OPEN_FOREVER not in node.states,
        "landable": LANDABLE in node.properties,
        "low": not (movable or is_basket or door or _is_high(node, task)),
        "floor": floor,
        "door": door,
        "basket": is_basket,
        "item": not (floor or door or is_basket),
    }
    return Object(
        object=name_of(node),
        kind=name_of(node),
        label=node.class_name,
        movable=movable,
        features=tuple(feature for feature, has in features.items() if has),
    )


def _is_high(node: Node, task: Task) -> bool:
    """Whether a dog does not reach it where it is at first."""
    high = (HIGH_HEIGHT in task.nodes[one].properties for one in _under(node, task))
    return bool({HIGH_HEIGHT, ON_HIGH_SURFACE} & set(node.properties)) or any(high)


def _under(node: Node, task: Task) -> Iterator[int]:
    """All that carries a node at first."""
    for edge in task.edges:
        if edge.of == node.id and edge.relation in (ON, INSIDE):
            yield edge.to
            yield from _under(task.nodes[edge.to], task)


def _arms_surfaces(task: Task) -> set[int]:
    """What arms are fixed on."""
    arms = {n.id for n in task.nodes.values() if n.class_name.replace("_", " ") == ROBOT_ARM}
    return {edge.to for edge in task.edges if edge.of in arms and edge.relation == ON}


def _opens(node: Node) -> bool:
    return node.class_name == DOOR or CONTAINERS in node.properties


def _doors(task: Task) -> Iterator[tuple[str, Node, Node, Node]]:
    """Ways through doors: name, door, and the rooms that it leads from and to."""
    for door in task.nodes.values():
        if door.class_name != DOOR:
            continue
        rooms = [e.to for e in task.edges if e.of == door.id and e.relation == LEADING_TO]
        for one in rooms:
            for other in rooms:
                if one != other:
                    yield f"way_{one}_{door.id}_{other}", door, task.nodes[one], task.nodes[other]


def _ways(task: Task) -> Iterator[Object]:
    for name, *_ in _doors(task):
        yield Object(object=name, kind="way", label=name, movable=False)


def _robot(node: Node, task: Task) -> RobotSpec:
    kind = node.class_name.replace("_", " ")
    if kind not in _SKILLS_OF:
        raise BadTaskFile(f"{task.name}: nothing is known of what {node} can do")
    return RobotSpec(
        robot=name_of(node), model=kind, skills=_SKILLS_OF[kind], capabilities=_CAPABILITIES[kind]
    )


def _facts(task: Task) -> Iterator[tuple[str, str, Value]]:
    """Relations, subjects and values."""
    nodes = task.nodes
    names = {node.id: name_of(node) for node in nodes.values()}
    for name, door, one, other in _doors(task):
        yield "door_of", name, names[door.id]
        yield "leads_from", name, names[one.id]
        yield "leads_to", name, names[other.id]
    for node in nodes.values():
        if _opens(node):
            yield IS_OPEN, names[node.id], bool({OPEN, OPEN_FOREVER} & set(node.states))
        if node.category == AGENTS and node.class_name != QUADROTOR:
            yield HOLDING, names[node.id], NOTHING
            for relation in ("beside", "support", "inner", "laid", "chosen"):
                yield relation, names[node.id], NOTHING
        for table in _arms_surfaces(task) & {node.id, *_under(node, task)}:
            if GRABABLE not in node.properties:
                yield "within", names[node.id], names[table]
    for of, relation, to in task.edges:
        node, where = nodes[of], nodes[to]
        if relation == WITH:
            yield "basket_of", names[of], names[to]
            yield "attended", names[to], NOTHING
        elif relation == INSIDE and where.category == ROOMS:
            yield AT, names[of], names[to]
            if node.category == FLOOR:
                yield "floor_of", names[to], names[of]
        elif relation in (ON, INSIDE) and node.category == AGENTS:
            yield from _stands(node, names[to])
        elif relation in (ON, INSIDE):
            _check_surface(task, node, where, relation)
            yield AT, names[of], names[to]


def _stands(robot: Node, where: str) -> Iterator[tuple[str, str, Value]]:
    if robot.class_name == QUADROTOR:
        yield "stands_on", name_of(robot), where
        yield "above", name_of(robot), NOTHING
    elif robot.class_name.replace("_", " ") == ROBOT_ARM:
        yield "mounted", name_of(robot), where


def _check_surface(task: Task, node: Node, where: Node, relation: str) -> None:
    """Where our world would say something else than the graph."""
    if relation == ON and CONTAINERS in where.properties and GRABABLE in node.properties:
        raise BadTaskFile(f"{task.name}: {node} is on {where}, which is a container")
