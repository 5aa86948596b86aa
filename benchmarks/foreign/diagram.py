"""Reliability diagram of the probabilities in files of ``table --csv``."""

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from benchmarks.foreign.scoring import calibration_error, row_of
from selfmodel.studies.statistics import proportion
from selfmodel.style import COLOURS, REFERENCE, figure_style


@figure_style()
def diagram(files: Sequence[Path]) -> Figure:
    """Returns how often what was said is so over its probability, with Wilson's 95 % intervals.

    A point has the diagnoses of a row of the reliability table, and their number.
    """
    lines = [line for file in files for line in csv.DictReader(file.read_text().splitlines())]
    stated = [line for line in lines if line["probability"]]
    if not stated:
        raise SystemExit(f"no probabilities are stated in {', '.join(map(str, files))}")
    said = np.array([float(line["probability"]) for line in stated])
    so = np.array([one["so"] == "True" for one in stated])
    place = row_of(said)
    lowest = min(0.4, said.min() - 0.05)
    figure = Figure(figsize=(4.4, 4.2), layout="constrained")
    axes = figure.subplots()
    axes.plot([0, 1], [0, 1], **REFERENCE)
    for row in np.unique(place):
        inside = place == row
        mean, share = said[inside].mean(), proportion(int(so[inside].sum()), int(inside.sum()))
        bars = [[max(share.estimate - share.low, 0)], [max(share.high - share.estimate, 0)]]
        axes.errorbar(mean, share.estimate, yerr=bars, fmt="o", capsize=2, color=COLOURS[0])
        axes.annotate(
            f"{inside.sum()}",
            (mean, share.estimate),
            (-5, 3),
            textcoords="offset points",
            ha="right",
        )
    error = calibration_error(said, so.astype(float), place)
    axes.set(
        title=f"{len(said)} diagnoses, calibration error {100 * error:.1f} %",
        xlabel="stated probability",
        ylabel="share that is so, 95 % interval",
        xlim=(lowest, 1),
        ylim=(lowest, 1.03),
        aspect="equal",
    )
    return figure
