"""Which thing an object is on or in, by where it is."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from keyexpr_schema.payloads.motions import PointM
from sim.files.world_schema import WorldFile
from sim.mujoco_world.mechanisms import Mechanisms

MARGIN_M = 0.02
SINKS_M = 0.03
STANDS_OUT_M = 0.08
"""The middle of what is in a bowl may be so far above its rim."""


class Carriers:
    """Everything that others can be on or in."""

    def __init__(self, model: Any, data: Any, world: WorldFile, mechanisms: Mechanisms) -> None:
        self._data, self._world, self._mechanisms = data, world, mechanisms
        self._objects = {
            name: (int(model.body(f"object/{name}").id), world.kind_of(name).extent_m)
            for name in world.object_entries
            if world.kind_of(name).carries
        }
        self._bodies = {name: int(model.body(f"object/{name}").id) for name in world.object_entries}

    def object_below(self, name: str, others: Iterable[str]) -> str | None:
        """That of the objects `others` which the object is in or on; the smallest, if several."""
        best: tuple[float, str] | None = None
        middle = self._data.xipos[self._bodies[name]]
        for other in others:
            if other == name or other not in self._objects:
                continue
            body, (length, width, height) = self._objects[other]
            frame = self._data.xmat[body].reshape(3, 3)
            x, y, z = (float(v) for v in (middle - self._data.xpos[body]) @ frame)
            size = length * width
            if (
                abs(x) <= length / 2
                and abs(y) <= width / 2
                and 0.0 <= z <= height + STANDS_OUT_M
                and (best is None or size < best[0])
            ):
                best = (size, other)
        return None if best is None else best[1]

    def at_fixture(self, fixture: str, point_m: PointM, above_m: float = 0.3) -> str | None:
        """The thing, a fixture or a part of it, on or in which a point is.

        The point may be up to `above_m` above an open top, and anywhere inside of what has walls.
        """
        about = self._world.fixtures.by_name.get(fixture)
        if about is None:
            return None
        best: tuple[float, str] | None = None
        x, y, z = about.local_m(point_m)
        for carrier in about.all_carriers:
            at = carrier.center_m
            mover = about.mover(carrier.thing)
            if mover is not None and carrier in mover.carriers:
                opening = self._mechanisms.opening(carrier.thing)
                at = mover.moved_m(at, opening * mover.open_at)
            length, width, height = carrier.size_m
            up = z - at[2]
            most = height if carrier.inside or carrier.roofed else above_m
            if (
                abs(x - at[0]) <= length / 2 + MARGIN_M
                and abs(y - at[1]) <= width / 2 + MARGIN_M
                and -SINKS_M <= up <= most
                and (best is None or abs(up) < best[0])
            ):
                best = (abs(up), carrier.thing)
        return None if best is None else best[1]
