"""How robots find their way and keep out of each other's. Pure: numpy and scipy only."""

from sim.navigation.navigator import Navigator
from sim.navigation.steering import Leg

__all__ = ["Leg", "Navigator"]
