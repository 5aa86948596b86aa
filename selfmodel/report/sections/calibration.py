"""Section of the calibration: errors before and after, and the factors with their intervals."""

import numpy as np

from selfmodel.report.charts import BarChart, Estimate, Group, IntervalChart
from selfmodel.report.document import Section
from selfmodel.report.subject import Subject
from selfmodel.simulation.calibration import UNDETERMINED, Calibration

Z = 1.96
"""Half width of a 95 % interval of a normal distribution, in standard deviations."""


def calibration_section(subject: Subject) -> Section | None:
    """Returns the section of the calibration; None without one."""
    fit = subject.calibration
    if fit is None:
        return None
    error = BarChart(
        title="Prediction error of the self-model on the healthy trials",
        x_label="root mean square error, in units of each signal's scale",
        names=("error",),
        groups=(Group("before", (fit.error_before,)), Group("after", (fit.error,))),
    )
    factors = IntervalChart(
        title="Fitted factors, with 95 % intervals",
        x_label="factor of the nominal value (1: as in the model)",
        estimates=tuple(_estimates(fit)),
        reference=1.0,
    )
    delay = fit.parameters.delay
    steps = f"{delay:g} {'step' if delay == 1 else 'steps'}"
    explained = (
        f"The self-model was fitted to the trials before the failure; the chosen set of parameters "
        f"is {fit.chosen}, with a control delay of {steps}. The prior of each factor is 1 with a "
        f"wide interval: a factor whose interval is as wide is {UNDETERMINED}."
    )
    text = [explained, *fit.contacts]
    text += [str(fit.suspicion)] if fit.suspicion is not None else []
    return Section("calibration", "Calibration", tuple(text), (error, factors))


def _estimates(fit: Calibration) -> list[Estimate]:
    found = []
    for row in fit.rows():
        value, deviation = row["factor"], row["deviation"]
        with np.errstate(over="ignore"):  # a deviation of a changed file may be of any size
            low, high = (float(value * np.exp(sign * Z * deviation)) for sign in (-1, 1))
        note = "" if row["determined"] else UNDETERMINED
        found.append(Estimate(row["name"], value, low, high, note))
    return found
