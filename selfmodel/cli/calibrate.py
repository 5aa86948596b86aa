"""``selfmodel calibrate``: the self-model fitted to logs of the healthy robot."""

from collections.abc import Sequence
from time import perf_counter
from typing import Any

from selfmodel import arguments
from selfmodel.cli.commands import Calibrate
from selfmodel.cli.inputs import check_new_file
from selfmodel.cli.output import print_json, print_lines, print_notes
from selfmodel.cli.progress import display
from selfmodel.cli.tables import show
from selfmodel.errors import InputError, counted
from selfmodel.logs.files import create_file
from selfmodel.simulation.calibration import UNDETERMINED, calibrate as fit_to
from selfmodel.simulation.fit import EXACT_ERROR, NOMINAL
from selfmodel.simulation.model_factors import FACTORS
from selfmodel.simulation.simulator import thread_count


def calibrate(options: Calibrate) -> None:
    """Fit masses, friction, damping, motors, delay and contacts of the self-model to trials."""
    start = perf_counter()
    check_new_file(options.out, ".xml")
    logs = arguments.read_logs(options.files)
    before = arguments.robot_of_logs(logs, options.self_model)
    if before.assets:
        raise InputError(
            f"{options.self_model or options.files[0]}: its model names other files "
            f"({', '.join(sorted(before.assets))}), and calibrate writes a single MJCF file: give "
            f"--robot a model without them, or give these logs to diagnose, which calibrates by "
            f"itself"
        )
    with display() as observer:
        trials = [log.trial for log in logs]
        fit = fit_to(before, trials, thread_count(options.threads), observer)
    with create_file(options.out) as file:
        file.write(fit.robot.mjcf.encode())
    result: dict[str, Any] = {
        "robot": before.name,
        "logs": [str(path) for path in options.files],
        "model": str(options.out),
        "parameters": fit.rows(),
        "delay": fit.parameters.delay,
        "delay_before": before.control_delay,
        "contact_stiffness": fit.parameters.contact_stiffness,
        "contact_damping": fit.parameters.contact_damping,
        "error_before": fit.error_before,
        "error": fit.error,
        "as_it_was": fit.robot is before,
        "set": fit.chosen,
        "held_out_gain": fit.held_out_gain,
        "suspicion": fit.suspicion.to_dict() if fit.suspicion else None,
        "joints": fit.joints,
        "seconds": perf_counter() - start,
    }
    if fit.suspicion is not None:
        print_notes(f"warning: {fit.suspicion}")
    if options.as_json:
        print_json(result)
        return
    if fit.joints is None:
        _print_factors(result, fit.contacts)
    else:
        _print_joints(result["joints"])
    print_lines(
        f"{options.out}: {before.name} as fitted to {counted(len(logs), 'log')} in "
        f"{result['seconds']:.1f} s"
    )


def _print_joints(fit: dict[str, Any]) -> None:
    """Prints the fit of the joints of a robot with a fixed base; see ``Calibration.joints``."""
    rows = [
        (
            f"{one['quantity']} of {one['name']}",
            f"{one['before']:.3g}",
            f"{one['value']:.3g}",
            f"± {100 * one['deviation']:.0f} %" if one["determined"] else "not determined",
        )
        for one in fit["parameters"]
    ]
    if fit["set"] != NOMINAL:
        show(("parameter", "before", "fitted", "uncertainty"), rows)
    print_lines(
        f"set of parameters: {fit['set']}; delay, control steps: {fit['delay']:g}",
        f"error of predicted motion: {fit['error']:.3f} ({fit['error_before']:.3f} before); in "
        f"segments that were left out of the fit {fit['held_out_error']:.3f} "
        f"({fit['held_out_error_before']:.3f} before)",
        f"largest error: {fit['worst_joint']}, {1e3 * fit['worst_joint_error']:.1f} mrad",
    )
    if fit["set"] == NOMINAL:
        print_lines(
            "No set of parameters predicts left-out segments significantly better: the model is "
            "written unchanged."
        )


def _print_factors(fit: dict[str, Any], contacts: Sequence[str]) -> None:
    rows = [
        (
            one["name"],
            "1",
            f"{one['factor']:.3f}",
            f"± {100 * one['deviation']:.1f} %" if one["determined"] else UNDETERMINED,
        )
        for one in fit["parameters"]
    ]
    end = (
        f"In segments that were left out of the fit, the loss is {100 * fit['held_out_gain']:.0f} "
        f"% lower than before."
    )
    better = "predict left-out segments significantly better"
    if fit["as_it_was"] and fit["error"] < EXACT_ERROR:
        end = "The model already predicts the logs exactly: it is written unchanged."
    elif fit["as_it_was"]:
        end = f"No parameters {better}: the model is written unchanged."
    elif fit["set"] != FACTORS:
        end = f"No factors {better}: they are unchanged."
    show(("factor of", "before", "fitted", "uncertainty"), rows)
    print_lines(
        f"delay, control steps: {fit['delay']} ({fit['delay_before']} before)",
        *contacts,
        f"error of predicted motion: {fit['error']:.3f} ({fit['error_before']:.3f} before), "
        f"the root mean square over predictions of 10 steps, each signal in its own scale",
        end,
    )
