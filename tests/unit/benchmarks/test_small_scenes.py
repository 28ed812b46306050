"""Plans of small scenes come near to the optimum by CP-SAT; the ways that it takes are offered."""

from __future__ import annotations

from itertools import islice

import pytest

from benchmarks.planning.small_scenes import Scene, compared, scenes
from fleet.service.composition import compose

PARTS = compose()
WORST = 1.1


def _scene(seed: int, number: int) -> Scene:
    return next(islice(scenes(number + 1, seed, carriers=True), number, None))


@pytest.mark.parametrize(
    ("seed", "number"),
    [
        pytest.param(1, 17, id="all ways offered had a carrier, and a hand alone was better"),
        pytest.param(1, 5, id="several things in one trip"),
        pytest.param(6, 1, id="two carriers, and the better hand goes alone"),
        pytest.param(6, 5, id="there were fewer carriers than ways with one"),
        pytest.param(7, 14, id="four things, one carrier, and all ways had one"),
        pytest.param(11, 12, id="plans for which there are too few robots came first"),
    ],
)
def test_a_plan_is_near_the_least_makespan(seed: int, number: int) -> None:
    found = compared(_scene(seed, number), PARTS, limit_s=60.0)
    assert found.optimum is not None
    assert found.optimum.proven
    assert not isinstance(found.planned_s, str), found.planned_s
    assert found.ratio is not None
    assert 0.99 <= found.ratio <= WORST
