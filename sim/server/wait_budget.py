"""How long a world without a pace may wait for robots that think."""

from __future__ import annotations

SHARE, RESERVE_S = 0.1, 5.0


class WaitBudget:
    """No more than a share of the time that the world has gone on for, beyond a reserve at first.

    Of many robots there is always one that thinks. All times are wall times [s].
    """

    def __init__(self) -> None:
        self.left_s = RESERVE_S

    def earn(self, went_on_s: float) -> None:
        """The world has gone on for so long."""
        self.left_s = min(RESERVE_S, self.left_s + SHARE * went_on_s)

    def spend(self, waited_s: float, held_up: int, thinking: int) -> None:
        """It has waited: that counts for each robot held up, divided by those that think."""
        self.left_s -= waited_s * held_up / thinking
