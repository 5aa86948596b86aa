"""Rough terrain: a field of random heights in the place of the level ground."""

from typing import TYPE_CHECKING

import numpy as np

from selfmodel.anatomy import Anatomy
from selfmodel.arrays import FloatArray
from selfmodel.errors import InputError
from selfmodel.faults.kind import Fault, Kind, between, grid

if TYPE_CHECKING:
    from mujoco import MjSpec

    from selfmodel.embodiment import Embodiment

HALF_EXTENT = (15.0, 8.0)
"""How far the field reaches from the start along x and y, m; beyond it there is nothing."""

CELL = 0.1
"""Distance between two heights of the field, m."""

BUMP = 3
"""Cells between two heights that are drawn; those between are interpolated."""

TERRAIN = "selfmodel_terrain"
"""What the field is called in a model."""

FLAT, LEVEL_OFF = 0.8, 0.4
"""Around the start the ground is flat up to this distance, and rises to its full roughness within
the other, m: no robot starts inside it."""


def unit_heights(seed: int) -> FloatArray:
    """Returns the heights of a terrain of roughness 1, ``(rows along y, columns along x)``.

    Heights are drawn evenly from [-1, 1] every ``BUMP`` cells; between them the ground is bilinear.
    """
    columns, rows = (round(2 * half / CELL) + 1 for half in HALF_EXTENT)
    drawn = np.random.default_rng(seed).uniform(-1, 1, (rows // BUMP + 2, columns // BUMP + 2))
    along_y = _interpolate(drawn, rows)
    heights = _interpolate(along_y.T, columns).T
    x = np.linspace(-HALF_EXTENT[0], HALF_EXTENT[0], columns)
    y = np.linspace(-HALF_EXTENT[1], HALF_EXTENT[1], rows)
    distance = np.sqrt(y[:, np.newaxis] ** 2 + x**2)
    rough: FloatArray = heights * np.clip((distance - FLAT) / LEVEL_OFF, 0, 1)
    return rough


def _interpolate(drawn: FloatArray, count: int) -> FloatArray:
    """``count`` rows between those that are drawn."""
    whole, part = np.divmod(np.arange(count), BUMP)
    weight = (part / BUMP)[:, np.newaxis]
    rows: FloatArray = drawn[whole] * (1 - weight) + drawn[whole + 1] * weight
    return rows


def _reshape(spec: "MjSpec", fault: Fault, seed: int) -> None:
    """Puts the terrain in the place of every level ground."""
    import mujoco  # noqa: PLC0415  # kinds of fault are known where there is no simulator

    planes = [geom for geom in spec.worldbody.geoms if geom.type == mujoco.mjtGeom.mjGEOM_PLANE]
    if not planes:
        raise InputError("roughness takes the place of a plane, and the model's world has none")
    heights = fault.degree * unit_heights(seed)
    low, high = float(heights.min()), float(heights.max())
    spec.add_hfield(
        name=TERRAIN,
        nrow=heights.shape[0],
        ncol=heights.shape[1],
        # The last is how thick the ground is below its lowest point.
        size=[*HALF_EXTENT, high - low, 1.0],
        userdata=((heights - low) / (high - low)).ravel(),
    )
    for plane in planes:
        plane.type = mujoco.mjtGeom.mjGEOM_HFIELD
        plane.hfieldname = TERRAIN
        # A plane has no end, wherever its middle is; a field is where the robot starts.
        plane.pos = [0.0, 0.0, plane.pos[2] + low]


def _strike(_embodiment: "Embodiment", _anatomy: Anatomy, _fault: Fault) -> None:
    """The terrain is in the model already."""


ROUGHNESS = Kind(
    name="roughness",
    word="roughness",
    strike=_strike,
    reshape=_reshape,
    degrees=between(0.0, 0.1),
    levels=grid(0.01, 0.02, 0.04),
    special={0.0: None},
    unit="m",
)
"""How far the ground rises above its mean height or falls below it, at most."""
