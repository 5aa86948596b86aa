"""Kinds of environments, and of faults of the whole robot: ground, wind, payload and delay."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.errors import InputError
from selfmodel.faults.kind import ENVIRONMENT, Fault, FaultKind
from selfmodel.robot.anatomy import Anatomy
from selfmodel.rotation import in_body_frame

if TYPE_CHECKING:
    from mujoco import MjSpec

    from selfmodel.robot.model_variant import ModelVariant

AIR_DENSITY = 1.2
"""Density of air at 20 degrees Celsius, kg/m^3; MuJoCo's default medium is a vacuum."""

AIR_VISCOSITY = 1.8e-5
"""Viscosity of air at 20 degrees Celsius, Pa s."""

PLACES = {ENVIRONMENT: 0.0, "front": 1.0, "back": -1.0}
"""Places of a payload by part: forward from the centre of mass, 1 at the end of the body."""

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


class Friction(FaultKind):
    """Coefficient of sliding friction between the ground and all geoms.

    No severity is nominal for every robot: the nominal friction is the model's.
    """

    def apply(self, variant: "ModelVariant", _anatomy: Anatomy, fault: Fault) -> None:
        """Sets the friction."""
        variant.set_friction(fault.severity)


class Slope(FaultKind):
    """Angle of the ground along forward, uphill positive.

    The ground and the initial pose are rotated about the initial position, and gravity is
    unchanged: the world's z axis points up in every logged signal, as in odometry that is aligned
    with gravity by an IMU.
    """

    def apply(self, variant: "ModelVariant", _anatomy: Anatomy, fault: Fault) -> None:
        """Tilts the ground and the robot."""
        variant.tilt_ground(fault.severity)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Wind(FaultKind):
    """Wind speed along an axis of the world; the medium is air if the model has none.

    Positive from behind or from right to left, negative against the robot or from left to right.

    Attributes:
        axis: 0 for x, 1 for y.
    """

    axis: int

    def apply(self, variant: "ModelVariant", _anatomy: Anatomy, fault: Fault) -> None:
        """Sets the wind."""
        option = variant.model.opt
        if option.density == option.viscosity == 0:  # a swimmer's model has its own medium
            option.density, option.viscosity = AIR_DENSITY, AIR_VISCOSITY
        option.wind[self.axis] = fault.severity


class Payload(FaultKind):
    """A mass on the root body, a fraction of the mass of the healthy robot.

    The parts are the places along the forward direction of the initial pose: no part is the centre
    of mass, ``front`` and ``back`` are the ends of the box of even density with the inertia of the
    root body. A robot has at most one payload: two of them are one elsewhere.
    """

    def parts(self, anatomy: Anatomy) -> tuple[str, ...]:
        """Returns the places; none for a fixed base."""
        return tuple(PLACES) if anatomy.floating_base else ()

    def apply(self, variant: "ModelVariant", anatomy: Anatomy, fault: Fault) -> None:
        """Adds the mass."""
        variant.load_body(anatomy.floating_base, fault.severity, PLACES[fault.part])


class GrownDelay(FaultKind):
    """A delay of commands: they take effect some control steps later than in the self-model.

    The effect is that of the nearest whole number of control steps. The delay of the robot and of
    the fault together is at most ``MAX_CONTROL_DELAY``: segments contain that many commands before
    their start.
    """

    def apply(self, variant: "ModelVariant", _anatomy: Anatomy, fault: Fault) -> None:
        """Sets the added delay."""
        variant.added_delay[:] = fault.severity


class Roughness(FaultKind):
    """Rough ground; the severity is the maximum deviation of the ground from its mean height, m."""

    def apply(self, _variant: "ModelVariant", _anatomy: Anatomy, _fault: Fault) -> None:
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

    def adapt_to_contacts(self, variant: "ModelVariant", fault: Fault, points: FloatArray) -> None:
        """Sets the height field to the estimated terrain, scaled by the severity."""
        import mujoco  # noqa: PLC0415  # faults/ imports without MuJoCo

        model = variant.model
        field = model.hfield(TERRAIN_NAME)
        fields = model.geom_type == mujoco.mjtGeom.mjGEOM_HFIELD
        (geom, *_) = np.flatnonzero(fields & (model.geom_dataid == field.id))
        in_field_frame = in_body_frame(points - model.geom_pos[geom], model.geom_quat[geom])
        # The data is a fraction of the field's height above the lowest drawn height.
        lowest = fault.severity * float(unit_heights(variant.seed).min())
        parts = (fault.severity * estimated_heights(in_field_frame) - lowest) / field.size[2]
        field.data[:] = np.clip(parts, 0, 1)


def unit_heights(seed: int) -> FloatArray:
    """Returns the heights of a terrain of roughness 1, ``(rows along y, columns along x)``.

    They are drawn uniformly from [-1, 1] every ``CELLS_PER_BUMP`` cells, and interpolated between.
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
    whole, part = np.divmod(np.arange(count), CELLS_PER_BUMP)
    weight = (part / CELLS_PER_BUMP)[:, np.newaxis]
    rows: FloatArray = drawn[whole] * (1 - weight) + drawn[whole + 1] * weight
    return rows


def estimated_heights(points: FloatArray) -> FloatArray:
    """Returns the terrain of roughness 1 estimated from contact points; see ``unit_heights``.

    The heights are scaled to the standard deviation of a terrain of roughness 1: the severity of
    the fault sets the scale, not the points. Cells without contacts have the height of the nearest
    cell with contacts. All heights are 0 with too few contacts beyond the flat ground. The points
    are contacts of the feet, in the frame of the ground, ``(n, 3)``, m.
    """
    from scipy.ndimage import distance_transform_edt  # noqa: PLC0415  # slow to import

    columns, rows = (round(2 * half / CELL_SIZE) + 1 for half in HALF_EXTENT)
    level = np.zeros((rows, columns))
    cells = np.round((points[:, :2] + HALF_EXTENT) / CELL_SIZE).astype(np.intp)
    inside = np.all((cells >= 0) & (cells < (columns, rows)), axis=1)
    if not inside.any():
        return level
    contact_cells, cell_index = np.unique(cells[inside], axis=0, return_inverse=True)
    counts = np.bincount(cell_index)
    order = np.argsort(cell_index, kind="stable")
    by_cell = np.split(points[inside, 2][order], np.cumsum(counts)[:-1])
    frequent = contact_cells[counts >= MIN_CELL_CONTACTS]
    estimated = np.array([np.median(one) for one in by_cell if len(one) >= MIN_CELL_CONTACTS])
    column, row = frequent.T
    distance = np.linalg.norm(frequent * CELL_SIZE - HALF_EXTENT, axis=1)
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


_SPEEDS = (-30.0, -25.0, -20.0, -16.0, -12.0, -8.0, -4.0, 4.0, 8.0, 12.0, 16.0, 20.0, 25.0, 30.0)

FRICTION = Friction(
    name="friction",
    base="free",
    bounds=(0.01, 3.0),
    levels=(0.1, 0.13, 0.16, 0.2, 0.25, 0.32, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.2, 1.5),
    unit="(coefficient)",
    words="the ground has a friction coefficient of {severity:.2g} (rubber on dry concrete: about "
    "0.8), unlike in the simulation model",
)
SLOPE = Slope(
    name="slope",
    base="free",
    bounds=(-0.6, 0.6),
    levels=(-0.3, -0.25, -0.2, -0.15, -0.1, -0.05, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3),
    degenerates_to={0.0: None},
    unit="rad",
    words="the robot starts facing {side}, on a slope of {degrees:.2g} degrees ({amount:.2g} rad)",
    sides=("downhill", "uphill"),
)
WIND, CROSSWIND = (
    Wind(
        name=name,
        base="free",
        axis=axis,
        bounds=(-40.0, 40.0),
        levels=_SPEEDS,
        degenerates_to={0.0: None},
        unit="m/s",
        words="a wind of {amount:.2g} m/s blows from the {side}, as seen at the start",
        sides=sides,
    )
    for axis, (name, sides) in enumerate(
        (("wind", ("front", "rear")), ("crosswind", ("left", "right")))
    )
)
PAYLOAD = Payload(
    name="payload",
    bounds=(0.0, 1.0),
    levels=(0.1, 0.2, 0.4, 0.8),
    degenerates_to={0.0: None},
    is_single=True,
    unit="of the robot's mass",
    words="the robot carries a load of {severity:.0%} of its mass{at}",
)
GROWN_DELAY = GrownDelay(
    name="delay",
    bounds=(0.0, 3.0),
    levels=(1.0, 2.0, 3.0),
    degenerates_to={0.0: None},
    unit="control steps",
    words="commands take effect {severity:.0f} control steps late",
)
ROUGHNESS = Roughness(
    name="roughness",
    base="free",
    bounds=(0.0, 0.1),
    levels=(0.01, 0.02, 0.04),
    degenerates_to={0.0: None},
    unit="m",
    words="the ground is uneven by {severity:.2g} m",
)
