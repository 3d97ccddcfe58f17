"""Robot models: what the single-rigid-body expert and the metrics must know of a robot.

Figures of ANYmal and HyQ are those of TOWR's public models (products of inertia are entered
there without the tensor's minus sign); the forward range of motion is tighter than the ±0.2 m
at which the paper judges replanners (Sec. 5.2), so that expert data keep a margin to it.
"""

import numpy as np
from pydantic import model_validator

from lmtr.arrays import Array
from lmtr.settings import Finite, Positive, Settings

FEET = ("LF", "RF", "LH", "RH")
"""Order of the feet in every array with a foot axis."""

N_FEET = len(FEET)

GRAVITY = 9.81
"""Gravitational acceleration (m/s²), along −z."""


class RobotModel(Settings):
    """A quadruped as a single rigid body on massless legs (Sec. 4.1; TOWR's robot model).

    Attributes:
        name: Name stored with every data set and model.
        mass: Total mass (kg).
        moments: Ixx, Iyy, Izz about the centre of mass, base axes (kg·m²).
        products: Ixy, Ixz, Iyz as ∫xy dm, …; they enter the tensor negated (kg·m²).
        nominal_forward: |x| of every foot's neutral position in the base frame (m).
        nominal_lateral: |y| of it (m).
        nominal_height: Height of the base above the feet in the neutral stance (m).
        range_of_motion: Half sides x, y, z of the box around the neutral position, in the base
            frame, that the expert keeps its feet in (m).
        friction: Coefficient μ of the friction pyramid.
    """

    name: str
    mass: Positive
    moments: tuple[Positive, Positive, Positive]
    products: tuple[Finite, Finite, Finite] = (0.0, 0.0, 0.0)
    nominal_forward: Positive
    nominal_lateral: Positive
    nominal_height: Positive
    range_of_motion: tuple[Positive, Positive, Positive]
    friction: Positive = 0.7

    @model_validator(mode="after")
    def _inertia_is_physical(self) -> "RobotModel":
        if np.linalg.eigvalsh(self.inertia_B).min() <= 0.0:
            raise ValueError(
                f"robot {self.name!r}: moments {self.moments} and products {self.products} give "
                "an inertia tensor that is not positive definite; check signs and units (kg·m²)"
            )
        return self

    @model_validator(mode="after")
    def _body_stays_above_its_feet(self) -> "RobotModel":
        if self.range_of_motion[2] >= self.nominal_height:
            raise ValueError(
                f"robot {self.name!r}: range_of_motion must be lower than nominal_height "
                f"{self.nominal_height} m in z, got {self.range_of_motion[2]} m, which lets feet "
                "be at the height of the base; lower it"
            )
        return self

    @property
    def inertia_B(self) -> Array:
        """Inertia tensor about the centre of mass in base axes, (3, 3) in kg·m²."""
        (xx, yy, zz), (xy, xz, yz) = self.moments, self.products
        return np.array([[xx, -xy, -xz], [-xy, yy, -yz], [-xz, -yz, zz]])

    @property
    def nominal_feet_B(self) -> Array:
        """Neutral foot positions in the base frame, (4, 3) in m."""
        x, y, z = self.nominal_forward, self.nominal_lateral, -self.nominal_height
        return np.array([[x, y, z], [x, -y, z], [-x, y, z], [-x, -y, z]])

    @property
    def weight(self) -> float:
        """Weight (N)."""
        return self.mass * GRAVITY


ANYMAL = RobotModel(
    name="anymal",
    mass=29.5,
    moments=(0.946438, 1.94478, 2.01835),
    products=(0.000938112, -0.00595386, -0.00146328),
    nominal_forward=0.34,
    nominal_lateral=0.19,
    nominal_height=0.42,
    range_of_motion=(0.16, 0.12, 0.10),
)

HYQ = RobotModel(
    name="hyq",
    mass=83.0,
    moments=(4.26, 8.97, 9.88),
    products=(-0.0063, 0.193, 0.0126),
    nominal_forward=0.31,
    nominal_lateral=0.29,
    nominal_height=0.58,
    range_of_motion=(0.20, 0.20, 0.10),
)

ROBOTS = {robot.name: robot for robot in (ANYMAL, HYQ)}
"""Built-in robots by name."""
