"""The calibration that a file of JSON values has."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from selfmodel.arguments import fitted
from selfmodel.robot.parameters import Parameters, factor_names, with_parameters
from selfmodel.robot.robot import Robot
from selfmodel.simulation.calibration import Calibration
from selfmodel.simulation.floating.fit import NOMINAL
from selfmodel.trials.trial import Trial


def recorded_calibration(
    robot: Robot, healthy: Sequence[Trial], values: Mapping[str, Any] | None, threads: int
) -> Calibration | None:
    """Returns the calibration of JSON values; None without healthy trials or without values.

    Values of a fit joint by joint do not determine its model: it is fitted again.

    Args:
        robot: The nominal robot.
        healthy: Trials of the healthy robot.
        values: What ``Calibration.to_dict`` returned; None for a diagnosis without a calibration.
        threads: Threads of the physics.

    Raises:
        ValueError: A value is of another robot, or no number.
        KeyError: A value is missing.
        TypeError: A value has another type.
    """
    if not healthy or values is None:
        return None
    if "joints" in values:
        return fitted(robot, healthy, threads)
    gains = tuple(map(float, values["motor_gains"]))
    # A calibration of version 0.1 has no contacts.
    stiffness, damping = (
        float(values.get(f"contact_{name}", 1.0)) for name in ("stiffness", "damping")
    )
    if not (0.01 <= stiffness <= 100 and 0.01 <= damping <= 100):
        raise ValueError("the factors of its contacts are not between 0.01 and 100")
    parameters = Parameters(
        root_mass=float(values["root_mass"]),
        limb_mass=float(values["limb_mass"]),
        friction=float(values["friction"]),
        damping=float(values["damping"]),
        motor_gains=gains,
        delay=float(values["delay"]),
        contact_stiffness=stiffness,
        contact_damping=damping,
    )
    chosen, deviations = str(values["set"]), np.array(values["deviations"], dtype=float)
    determined = tuple(map(bool, values["determined"]))
    factors = len(factor_names(robot))
    sizes = {len(parameters.factors), deviations.size, len(determined) or factors}
    if sizes != {factors}:
        raise ValueError(f"its calibration has {sorted(sizes)} factors, and {factors} are expected")
    return Calibration(
        robot=robot if chosen == NOMINAL else with_parameters(robot, parameters),
        parameters=parameters,
        deviations=deviations,
        error_before=float(values["error_before"]),
        error=float(values["error"]),
        chosen=chosen,
        determined=determined,
        held_out_gain=float(values["held_out_gain"]),
    )
