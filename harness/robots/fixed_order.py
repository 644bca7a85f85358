"""An arm's kinematics with the same bits on every processor, for the targets of pose actions.

The sum, product, quotient and square root of two doubles have one result wherever IEEE 754 holds.
What differs between processors is the order in which BLAS adds, and the last bit of sines in the C
library and in numpy. So this module computes with Python's floats in a written order, and has a
sine and cosine of its own. It is scalar and does one pose at a time; `kinematics` does many.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import factorial
from typing import cast

from robospa.geometry import Pose, matrix_rows
from robospa.harness.robots.kinematics import Chain

Vector = tuple[float, float, float]
Rows = tuple[Vector, Vector, Vector]

DAMPING = 1e-6
TWO_OVER_PI = 0.6366197723675814
HALF_PI = (1.5707963267341256, 6.077100506506192e-11)
"""Pi/2 as a sum; the first part has 33 bits, so that small multiples of it are exact."""
SINE = tuple((-1.0) ** k / factorial(2 * k + 1) for k in range(1, 9))
COSINE = tuple((-1.0) ** k / factorial(2 * k) for k in range(1, 9))
"""Taylor coefficients of sin(x)/x - 1 and cos(x) - 1 in powers of x*x, for |x| <= pi/4."""


@dataclass(frozen=True, slots=True)
class FixedPose:
    """A rigid transform: rotation matrix `turn` (rows) and position `at` [m]."""

    turn: Rows
    at: Vector

    def __mul__(self, other: FixedPose) -> FixedPose:
        """The frame `other`, given in this one, in the frame that this one is in."""
        (a, b, c), (p, q, r), (u, v, w) = self.turn
        (d, e, f), (g, h, i), (j, k, m) = other.turn
        x, y, z = self.apply(other.at)
        turn = (
            (a * d + b * g + c * j, a * e + b * h + c * k, a * f + b * i + c * m),
            (p * d + q * g + r * j, p * e + q * h + r * k, p * f + q * i + r * m),
            (u * d + v * g + w * j, u * e + v * h + w * k, u * f + v * i + w * m),
        )
        return FixedPose(turn, (x, y, z))

    def turned(self, vector: Vector) -> Vector:
        """`vector` of this frame in the parent's directions."""
        x, y, z = vector
        (a, b, c), (p, q, r), (u, v, w) = self.turn
        return (a * x + b * y + c * z, p * x + q * y + r * z, u * x + v * y + w * z)

    def apply(self, point: Vector) -> Vector:
        """`point` [m] of this frame in the parent frame."""
        x, y, z = self.turned(point)
        return (self.at[0] + x, self.at[1] + y, self.at[2] + z)


@dataclass(frozen=True, slots=True)
class FixedChain:
    """A `Chain` as plain numbers, ending in the end-effector frame; limits in rad."""

    base: FixedPose
    origins: tuple[FixedPose, ...]
    axes: tuple[Vector, ...]
    tool: FixedPose
    lower: tuple[float, ...]
    upper: tuple[float, ...]


def fixed_chain(chain: Chain) -> FixedChain:
    """The numbers of `chain`."""

    def frame(rows: Sequence[Sequence[float]]) -> FixedPose:
        turn = tuple((row[0], row[1], row[2]) for row in rows[:3])
        return FixedPose(cast(Rows, turn), (rows[0][3], rows[1][3], rows[2][3]))

    return FixedChain(
        base=frame(chain.base.tolist()),
        origins=tuple(frame(rows) for rows in chain.origins.tolist()),
        axes=tuple((x, y, z) for x, y, z in chain.axes.tolist()),
        tool=frame(chain.tool.tolist()),
        lower=tuple(chain.lower.tolist()),
        upper=tuple(chain.upper.tolist()),
    )


def frame_of(pose: Pose) -> FixedPose:
    """`pose` with its rotation as a matrix."""
    return FixedPose(cast(Rows, matrix_rows(*pose.rotation)), pose.position)


def end_frame(chain: FixedChain, joints: Sequence[float]) -> FixedPose:
    """The end-effector frame in the world at `joints` [rad]."""
    return _forward(chain, joints)[0]


def refined(chain: FixedChain, joints: Sequence[float], goal: FixedPose, count: int) -> list[float]:
    """`joints` [rad] that almost reach `goal`, brought onto it by `count` Gauss-Newton steps within
    the joint limits."""
    now = list(joints)
    for _ in range(count):
        end, columns = _forward(chain, now)
        error = _error(end, goal)
        square = [[_dot(a, b) for b in columns] for a in columns]
        for i in range(len(now)):
            square[i][i] += DAMPING
        step = _solve(square, [_dot(column, error) for column in columns])
        now = [
            min(max(q + change, low), high)
            for q, change, low, high in zip(now, step, chain.lower, chain.upper, strict=True)
        ]
    return now


def sine_cosine(angle: float) -> tuple[float, float]:
    """Sine and cosine of `angle` [rad], of which |angle| < 1000; good to about 1e-16."""
    quarter = round(angle * TWO_OVER_PI)
    x = (angle - quarter * HALF_PI[0]) - quarter * HALF_PI[1]
    square = x * x
    sine, cosine = 0.0, 0.0
    for s, c in zip(reversed(SINE), reversed(COSINE), strict=True):
        sine = (sine + s) * square
        cosine = (cosine + c) * square
    sine, cosine = x + x * sine, 1.0 + cosine
    turned = ((sine, cosine), (cosine, -sine), (-sine, -cosine), (-cosine, sine))
    return turned[quarter % 4]


def _about(axis: Vector, angle: float) -> FixedPose:
    """The rotation by `angle` [rad] about a unit axis."""
    x, y, z = axis
    s, c = sine_cosine(angle)
    t = 1.0 - c
    turn = (
        (c + t * x * x, t * x * y - s * z, t * x * z + s * y),
        (t * x * y + s * z, c + t * y * y, t * y * z - s * x),
        (t * x * z - s * y, t * y * z + s * x, c + t * z * z),
    )
    return FixedPose(turn, (0.0, 0.0, 0.0))


def _forward(
    chain: FixedChain, joints: Sequence[float]
) -> tuple[FixedPose, list[tuple[float, ...]]]:
    """The end-effector frame, and the column of each joint in the geometric Jacobian (6)."""
    frame = chain.base
    hinges: list[tuple[Vector, Vector]] = []
    for origin, axis, angle in zip(chain.origins, chain.axes, joints, strict=True):
        frame = frame * origin
        hinges.append((frame.at, frame.turned(axis)))
        frame = frame * _about(axis, angle)
    end = frame * chain.tool
    columns: list[tuple[float, ...]] = []
    for (px, py, pz), (x, y, z) in hinges:
        dx, dy, dz = end.at[0] - px, end.at[1] - py, end.at[2] - pz
        columns.append((y * dz - z * dy, z * dx - x * dz, x * dy - y * dx, x, y, z))
    return end, columns


def _error(end: FixedPose, goal: FixedPose) -> tuple[float, ...]:
    """Position and rotation (6) still to go: the axis times the sine of the angle."""
    back = FixedPose(cast(Rows, tuple(zip(*end.turn, strict=True))), (0.0, 0.0, 0.0))
    (_, b, c), (p, _, r), (u, v, _) = (FixedPose(goal.turn, (0.0, 0.0, 0.0)) * back).turn
    x, y, z = (g - e for g, e in zip(goal.at, end.at, strict=True))
    return (x, y, z, (v - r) / 2, (c - u) / 2, (p - b) / 2)


def _dot(a: Sequence[float], b: Sequence[float]) -> float:
    """Scalar product, added from the first to the last (sum() is compensated in some Pythons)."""
    total = 0.0
    for x, y in zip(a, b, strict=True):
        total += x * y
    return total


def _solve(matrix: list[list[float]], right: list[float]) -> list[float]:
    """x of `matrix` x = `right`, both overwritten; positive definite, so no row is exchanged."""
    size = len(right)
    for i in range(size):
        for row in range(i + 1, size):
            share = matrix[row][i] / matrix[i][i]
            for column in range(i, size):
                matrix[row][column] -= share * matrix[i][column]
            right[row] -= share * right[i]
    found = [0.0] * size
    for i in reversed(range(size)):
        found[i] = (right[i] - _dot(matrix[i][i + 1 :], found[i + 1 :])) / matrix[i][i]
    return found
