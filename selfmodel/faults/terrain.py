"""Rough terrain: a field of random heights in the place of the level ground."""

import math
from typing import TYPE_CHECKING

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.errors import InputError
from selfmodel.faults.kind import Fault, FaultKind, uniform_bounds, uniform_levels
from selfmodel.robot.anatomy import Anatomy
from selfmodel.trials.rotation import rotated

if TYPE_CHECKING:
    from mujoco import MjSpec

    from selfmodel.robot.embodiment import Embodiment

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


TOUCHES, PLACES = 3, 10
"""How often a foot must have touched a cell for its height to be known (a touch sensor errs), and
how many cells must be known to know how the ground varies."""

DEVIATION = 2 / 3 / math.sqrt(3)
"""The standard deviation of a terrain of roughness 1: of heights drawn evenly from [-1, 1], times
what bilinear interpolation leaves of it along each of two axes, the root of 2/3."""


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
    heights = fault.severity * unit_heights(seed)
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


def felt_heights(points: FloatArray) -> FloatArray:
    """Returns the shape of a terrain as feet felt it, as ``unit_heights`` has it.

    How high it is, the points do not decide: the heights are those of a terrain of roughness 1 that
    varies as much. Where no foot has been, the ground is as at the nearest place where one was. All
    0 where too little was felt beyond the flat ground around the start.

    Args:
        points: Where feet touched the ground, in its own frame, ``(n, 3)``, m.
    """
    from scipy.ndimage import distance_transform_edt  # noqa: PLC0415  # a quarter of the help's time

    columns, rows = (round(2 * half / CELL) + 1 for half in HALF_EXTENT)
    level = np.zeros((rows, columns))
    cells = np.round((points[:, :2] + HALF_EXTENT) / CELL).astype(np.intp)
    inside = np.all((cells >= 0) & (cells < (columns, rows)), axis=1)
    if not inside.any():
        return level
    places, of_place = np.unique(cells[inside], axis=0, return_inverse=True)
    order = np.argsort(of_place, kind="stable")
    touches = np.split(points[inside, 2][order], np.cumsum(np.bincount(of_place))[:-1])
    often = np.array([len(heights) >= TOUCHES for heights in touches], dtype=bool)
    felt = np.array([np.median(heights) for heights in touches if len(heights) >= TOUCHES])
    column, row = places[often].T
    distance = np.linalg.norm(places[often] * CELL - HALF_EXTENT, axis=1)
    flat, rough = distance < FLAT, distance > FLAT + LEVEL_OFF
    if rough.sum() < PLACES:
        return level
    above = felt - np.median(felt[flat] if flat.any() else felt)
    usual = math.sqrt(np.square(above[rough]).mean())
    if not usual > 0:
        return level
    known = np.zeros(level.shape, dtype=bool)
    known[row, column] = True
    level[row, column] = np.clip(above * DEVIATION / usual, -1, 1)
    nearest = distance_transform_edt(~known, return_distances=False, return_indices=True)
    return np.asarray(level[tuple(nearest)])


def _feel(embodiment: "Embodiment", fault: Fault, points: FloatArray) -> None:
    """Gives the terrain the shape that was felt, as high as the fault says."""
    import mujoco  # noqa: PLC0415  # kinds of fault are known where there is no simulator

    model = embodiment.model
    field = model.hfield(TERRAIN)
    fields = model.geom_type == mujoco.mjtGeom.mjGEOM_HFIELD
    (geom, *_) = np.flatnonzero(fields & (model.geom_dataid == field.id))
    back = model.geom_quat[geom] * (1.0, -1.0, -1.0, -1.0)
    in_its_frame = rotated(points - model.geom_pos[geom], back)
    # The data is in parts of the field's height, from the lowest of the heights that were drawn.
    lowest = fault.severity * float(unit_heights(embodiment.seed).min())
    parts = (fault.severity * felt_heights(in_its_frame) - lowest) / field.size[2]
    field.data[:] = np.clip(parts, 0, 1)


def _apply(_embodiment: "Embodiment", _anatomy: Anatomy, _fault: Fault) -> None:
    """The terrain is in the model already."""


ROUGHNESS = FaultKind(
    name="roughness",
    keyword="roughness",
    apply=_apply,
    edit_spec=_reshape,
    feel=_feel,
    severity_bounds=uniform_bounds(0.0, 0.1),
    levels=uniform_levels(0.01, 0.02, 0.04),
    degenerates_to={0.0: None},
    unit="m",
)
"""How far the ground rises above its mean height or falls below it, at most."""
