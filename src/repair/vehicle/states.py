"""States of a driven vehicle over time."""

from __future__ import annotations

from dataclasses import dataclass

from repair.arrays import Array

__all__ = ["DrivenStates"]


@dataclass(frozen=True)
class DrivenStates:
    """States of the kinematic single-track model, all (K,).

    Attributes
    ----------
    t : array
        Time [s].
    x, y : array
        Centre of the vehicle [m].
    steering : array
        Steering angle delta of the front wheels [rad].
    speed : array
        Speed at the rear axle [m/s].
    orientation : array
        Orientation psi of the body [rad], unwrapped.
    """

    t: Array
    x: Array
    y: Array
    steering: Array
    speed: Array
    orientation: Array

    def __len__(self) -> int:
        return len(self.t)

    def every(self, n: int) -> DrivenStates:
        """Every ``n``-th state, the first included."""
        return DrivenStates(
            self.t[::n], self.x[::n], self.y[::n], self.steering[::n], self.speed[::n], self.orientation[::n]
        )

    def since(self, t: float) -> DrivenStates:
        """The states from a time [s] on."""
        late = self.t >= t
        return DrivenStates(
            self.t[late], self.x[late], self.y[late], self.steering[late], self.speed[late],
            self.orientation[late],
        )  # fmt: skip
