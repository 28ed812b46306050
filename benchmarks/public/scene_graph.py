"""COHERENT's files: a household as a graph of nodes and relations, and the relations wanted."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import msgspec

from benchmarks.public.errors import BadTaskFile

ROOMS, FLOOR, AGENTS = "Rooms", "Floor", "Agents"
DOOR, QUADROTOR, ROBOT_DOG, ROBOT_ARM = "door", "quadrotor", "robot dog", "robot arm"
ON, INSIDE, LEADING_TO, WITH = "ON", "INSIDE", "LEADING TO", "WITH"
ABOVE, CLOSE, HOLD = "ABOVE", "CLOSE", "HOLD"
OPEN, CLOSED, OPEN_FOREVER, LAND, FLYING = "OPEN", "CLOSED", "OPEN_FOREVER", "LAND", "FLYING"
SURFACES, CONTAINERS, GRABABLE, LANDABLE = "SURFACES", "CONTAINERS", "GRABABLE", "LANDABLE"
HIGH_HEIGHT, LOW_HEIGHT, ON_HIGH_SURFACE = "HIGH_HEIGHT", "LOW_HEIGHT", "ON_HIGH_SURFACE"
_GOAL = re.compile(r"(on|inside)_<[^>]*>\((\d+)\)_<[^>]*>\((\d+)\)")


class Node(msgspec.Struct, frozen=True):
    """A room, a robot or a thing."""

    id: int
    category: str
    class_name: str
    properties: list[str]
    states: list[str]

    def __str__(self) -> str:
        return f"<{self.class_name}>({self.id})"


class Edge(NamedTuple):
    """That one node has a relation to another."""

    of: int
    relation: str
    to: int


@dataclass(frozen=True)
class Task:
    """One task: how everything is at first, what is wanted, and how long its reference plan is."""

    env: str
    number: int
    nodes: dict[int, Node]
    edges: tuple[Edge, ...]
    goal: tuple[Edge, ...]
    reference_steps: int

    @property
    def name(self) -> str:
        """File and number."""
        return f"{self.env}-{self.number}"

    @property
    def robots(self) -> list[int]:
        """The robots, by id."""
        return sorted(n.id for n in self.nodes.values() if n.category == AGENTS)


class _EdgeRow(msgspec.Struct):
    from_id: int
    to_id: int
    relation_type: str


class _Graph(msgspec.Struct):
    nodes: list[Node]
    edges: list[_EdgeRow]


class _TaskRow(msgspec.Struct):
    task_id: int
    init_graph: _Graph
    task_goal: dict[str, tuple[int, list[object]]]
    ground_truth_step_num: list[int]


def tasks_in(folder: Path) -> list[Task]:
    """The tasks of all files `env*.json` in a folder, or in `env` in it.

    Raises:
        BadTaskFile: there are none, or one is not as the set's are.
    """
    files = sorted(folder.glob("env*.json")) or sorted(folder.glob("env/env*.json"))
    if not files:
        raise BadTaskFile(f"{folder}: there are no files env*.json, nor in {folder / 'env'}")
    return [task for path in files for task in tasks_of(path)]


def tasks_of(path: Path) -> list[Task]:
    """The tasks of one file.

    Raises:
        BadTaskFile: it is not as the set's are.
    """
    try:
        rows = msgspec.json.decode(path.read_bytes(), type=list[_TaskRow])
    except (OSError, msgspec.DecodeError) as error:
        raise BadTaskFile(f"{path}: {error}") from error
    return [_task(path.stem, row, f"{path}: task {row.task_id}") for row in rows]


def _task(env: str, row: _TaskRow, where: str) -> Task:
    # Of two nodes with one id the later one counts, as it does in the set's own programs.
    nodes = {node.id: node for node in row.init_graph.nodes}
    edges = tuple(Edge(e.from_id, e.relation_type, e.to_id) for e in row.init_graph.edges)
    if unknown := {end for e in edges for end in (e.of, e.to)} - nodes.keys():
        raise BadTaskFile(f"{where}: relations speak of {sorted(unknown)}, which are no nodes")
    if len(row.ground_truth_step_num) != 1:
        raise BadTaskFile(f"{where}: ground_truth_step_num must be one number")
    goal = tuple(_goal(text, count, nodes, where) for text, (count, _) in row.task_goal.items())
    return Task(env, row.task_id, nodes, edges, goal, row.ground_truth_step_num[0])


def _goal(text: str, count: int, nodes: dict[int, Node], where: str) -> Edge:
    found = _GOAL.fullmatch(text)
    if found is None or count != 1:
        raise BadTaskFile(f"{where}: {text} is no goal such as on_<cup>(1)_<table>(2): [1, []]")
    of, to = int(found[2]), int(found[3])
    if unknown := {of, to} - nodes.keys():
        raise BadTaskFile(f"{where}: {text} speaks of {sorted(unknown)}, which are no nodes")
    return Edge(of, found[1].upper(), to)
