"""Rough terrain: a height field with random heights instead of the ground plane."""

import math
from typing import TYPE_CHECKING

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.errors import InputError
from selfmodel.faults.kind import Fault, FaultKind
from selfmodel.robot.anatomy import Anatomy
from selfmodel.trials.rotation import rotated

if TYPE_CHECKING:
    from mujoco import MjSpec

    from selfmodel.robot.embodiment import Embodiment

HALF_EXTENT = (15.0, 8.0)
"""Half the extent of the field along x and y, m, centred on the initial position."""

CELL_SIZE = 0.1
"""Grid spacing of the field, m."""

CELLS_PER_BUMP = 3
"""Cells between two random heights; the heights in between are interpolated."""

TERRAIN_NAME = "selfmodel_terrain"
"""Name of the height field in a model."""

FLAT_RADIUS, TRANSITION_WIDTH = 0.8, 0.4
"""Radius of the flat ground around the initial position, and width of the transition to the full
roughness, m: no robot starts inside the terrain."""

MIN_CELL_CONTACTS, MIN_CELLS = 3, 10
"""Minimum contacts per cell for an estimate of its height, because touch readings may be wrong, and
minimum estimated cells for an estimate of the terrain."""

UNIT_DEVIATION = 2 / 3 / math.sqrt(3)
"""Standard deviation of a terrain of roughness 1: that of the uniform distribution on [-1, 1],
1 / sqrt(3), times sqrt(2/3) for bilinear interpolation along each of two axes."""


def unit_heights(seed: int) -> FloatArray:
    """Returns the heights of a terrain of roughness 1, ``(rows along y, columns along x)``.

    Heights are drawn uniformly from [-1, 1] every ``CELLS_PER_BUMP`` cells; the heights in between
    are interpolated bilinearly.
    """
    columns, rows = (round(2 * half / CELL_SIZE) + 1 for half in HALF_EXTENT)
    drawn = np.random.default_rng(seed).uniform(
        -1, 1, (rows // CELLS_PER_BUMP + 2, columns // CELLS_PER_BUMP + 2)
    )
    along_y = _interpolate(drawn, rows)
    heights = _interpolate(along_y.T, columns).T
    x = np.linspace(-HALF_EXTENT[0], HALF_EXTENT[0], columns)
    y = np.linspace(-HALF_EXTENT[1], HALF_EXTENT[1], rows)
    distance = np.sqrt(y[:, np.newaxis] ** 2 + x**2)
    rough: FloatArray = heights * np.clip((distance - FLAT_RADIUS) / TRANSITION_WIDTH, 0, 1)
    return rough


def _interpolate(drawn: FloatArray, count: int) -> FloatArray:
    """Returns ``count`` rows, interpolated between the drawn rows."""
    whole, part = np.divmod(np.arange(count), CELLS_PER_BUMP)
    weight = (part / CELLS_PER_BUMP)[:, np.newaxis]
    rows: FloatArray = drawn[whole] * (1 - weight) + drawn[whole + 1] * weight
    return rows


def estimated_heights(points: FloatArray) -> FloatArray:
    """Returns the terrain of roughness 1 estimated from contact points; see ``unit_heights``.

    The heights are scaled to the standard deviation of a terrain of roughness 1: the severity of
    the fault sets the scale, not the points. Cells without contacts have the height of the nearest
    cell with contacts. All heights are 0 with too few contacts beyond the flat ground.

    Args:
        points: Contact points of the feet, in the frame of the ground, ``(n, 3)``, m.
    """
    from scipy.ndimage import distance_transform_edt  # noqa: PLC0415  # slow to import

    columns, rows = (round(2 * half / CELL_SIZE) + 1 for half in HALF_EXTENT)
    level = np.zeros((rows, columns))
    cells = np.round((points[:, :2] + HALF_EXTENT) / CELL_SIZE).astype(np.intp)
    inside = np.all((cells >= 0) & (cells < (columns, rows)), axis=1)
    if not inside.any():
        return level
    contact_cells, cell_index = np.unique(cells[inside], axis=0, return_inverse=True)
    order = np.argsort(cell_index, kind="stable")
    heights_by_cell = np.split(points[inside, 2][order], np.cumsum(np.bincount(cell_index))[:-1])
    frequent = np.array(
        [len(heights) >= MIN_CELL_CONTACTS for heights in heights_by_cell], dtype=bool
    )
    estimated = np.array(
        [np.median(heights) for heights in heights_by_cell if len(heights) >= MIN_CELL_CONTACTS]
    )
    column, row = contact_cells[frequent].T
    distance = np.linalg.norm(contact_cells[frequent] * CELL_SIZE - HALF_EXTENT, axis=1)
    flat, rough = distance < FLAT_RADIUS, distance > FLAT_RADIUS + TRANSITION_WIDTH
    if rough.sum() < MIN_CELLS:
        return level
    above = estimated - np.median(estimated[flat] if flat.any() else estimated)
    deviation = math.sqrt(np.square(above[rough]).mean())
    if not deviation > 0:
        return level
    observed = np.zeros(level.shape, dtype=bool)
    observed[row, column] = True
    level[row, column] = np.clip(above * UNIT_DEVIATION / deviation, -1, 1)
    nearest = distance_transform_edt(~observed, return_distances=False, return_indices=True)
    return np.asarray(level[tuple(nearest)])


class Roughness(FaultKind):
    """Rough ground; the severity is the maximum deviation of the ground from its mean height, m."""

    def apply(self, _embodiment: "Embodiment", _anatomy: Anatomy, _fault: Fault) -> None:
        """Does nothing: ``edit_specification`` has added the terrain."""

    def edit_specification(self, spec: "MjSpec", fault: Fault, seed: int) -> None:
        """Replaces every ground plane by the terrain."""
        import mujoco  # noqa: PLC0415  # faults/ imports without MuJoCo

        planes = [geom for geom in spec.worldbody.geoms if geom.type == mujoco.mjtGeom.mjGEOM_PLANE]
        if not planes:
            raise InputError("roughness replaces a ground plane, and the model's world has none")
        heights = fault.severity * unit_heights(seed)
        low, high = float(heights.min()), float(heights.max())
        spec.add_hfield(
            name=TERRAIN_NAME,
            nrow=heights.shape[0],
            ncol=heights.shape[1],
            # The last size is the thickness below the lowest point.
            size=[*HALF_EXTENT, high - low, 1.0],
            userdata=((heights - low) / (high - low)).ravel(),
        )
        for plane in planes:
            plane.type = mujoco.mjtGeom.mjGEOM_HFIELD
            plane.hfieldname = TERRAIN_NAME
            # A plane's centre is arbitrary; that of the field is the initial position.
            plane.pos = [0.0, 0.0, plane.pos[2] + low]

    def adapt_to_contacts(self, embodiment: "Embodiment", fault: Fault, points: FloatArray) -> None:
        """Sets the height field to the estimated terrain, scaled by the severity."""
        import mujoco  # noqa: PLC0415  # faults/ imports without MuJoCo

        model = embodiment.model
        field = model.hfield(TERRAIN_NAME)
        fields = model.geom_type == mujoco.mjtGeom.mjGEOM_HFIELD
        (geom, *_) = np.flatnonzero(fields & (model.geom_dataid == field.id))
        inverse = model.geom_quat[geom] * (1.0, -1.0, -1.0, -1.0)
        in_field_frame = rotated(points - model.geom_pos[geom], inverse)
        # The data is a fraction of the field's height above the lowest drawn height.
        lowest = fault.severity * float(unit_heights(embodiment.seed).min())
        parts = (fault.severity * estimated_heights(in_field_frame) - lowest) / field.size[2]
        field.data[:] = np.clip(parts, 0, 1)


ROUGHNESS = Roughness(
    name="roughness",
    bounds=(0.0, 0.1),
    levels=(0.01, 0.02, 0.04),
    degenerates_to={0.0: None},
    unit="m",
)
