"""Power of three losses to show a fault of one joint, on recordings of ``benchmarks.foreign``.

``python -m benchmarks.joint_losses RECORDINGS`` takes a folder that ``python -m benchmarks.foreign
generate RECORDINGS --cases wide,healthy`` has written, and prints a row per recording: standard
errors, paired over the segments, by which the true hypothesis is better than ``intact``, and than
the best other kind of fault at the same joint, for the loss, for the loss plus the mean over the
losses of all hinges, and for the loss of the joint alone; and the largest excess of any joint over
the healthy trial under ``intact``.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from selfmodel import arguments
from selfmodel.arrays import FloatArray
from selfmodel.comparators import SEGMENT_PREDICTION
from selfmodel.diagnosis.evidence import Evidence
from selfmodel.diagnosis.joint_losses import JointLosses
from selfmodel.diagnosis.search.severity import with_fitted_severity
from selfmodel.diagnosis.verdicts.significance import paired_z
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.kind import Fault
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import ALL_KINDS
from selfmodel.simulation.calibration import calibrate
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trial import Trial


@dataclass(frozen=True, eq=False)
class Recording:
    """A recording, imported, with the self-model calibrated on its healthy trial.

    Attributes:
        evidence: Losses of hypotheses.
        space: All hypotheses about the robot.
        before: Healthy trial.
        after: Trial to explain.
    """

    evidence: Evidence
    space: HypothesisSpace
    before: Trial
    after: Trial

    @property
    def joints(self) -> JointLosses:
        """The losses of single joints."""
        return JointLosses(
            self.space.anatomy,
            damaged=lambda some: self.evidence.losses_by_hinge(some, [self.after]),
            healthy=lambda some: self.evidence.losses_by_hinge(some, [self.before]),
        )


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recordings", type=Path)
    options = parser.parse_args()
    print("| recording | truth | vs intact | vs another kind | largest excess |")
    print("|---|---|---|---|---|")
    for path in sorted(options.recordings.glob("*/truth.json")):
        truth = "+".join(json.loads(path.read_text())["truth"]) or "intact"
        if "backlash" not in truth:
            print(f"| {' | '.join([path.parent.name, truth, *cells(path.parent, truth)])} |")


def cells(folder: Path, truth: str) -> list[str]:
    """Returns the numbers of a recording; those of the three losses are separated by slashes."""
    recording = imported(folder)
    worst, excess = next(iter(recording.joints.excess(INTACT).items()))
    hypothesis = parse(truth, recording.space.anatomy)
    largest = f"{worst} {excess:.1f}"
    if len(hypothesis) != 1 or not hypothesis.faults[0].kind.is_of_joint:
        return ["", "", largest]
    joint = hypothesis.faults[0].part
    others = of_other_kinds(recording, hypothesis.faults[0])
    rows = three_losses(recording, joint, [hypothesis, INTACT, *others])
    return [
        " / ".join(f"{paired_z(row[1], row[0]):.1f}" for row in rows),
        " / ".join(f"{min(paired_z(other, row[0]) for other in row[2:]):.1f}" for row in rows),
        largest,
    ]


def imported(folder: Path) -> Recording:
    """Returns a recording of ``benchmarks.foreign``."""
    with tempfile.TemporaryDirectory() as made:
        paths = [Path(made, f"{name}.mcap") for name in ("before", "after-1")]
        for path in paths:
            command = ["logs", "import", path.stem, "--mapping", f"{path.stem}.toml"]
            subprocess.run(
                [sys.executable, "-m", "selfmodel", *command, "--out", str(path)],
                cwd=folder,
                check=True,
                capture_output=True,
            )
        logs = arguments.read_logs(paths)
    before, after = (log.trial for log in logs)
    robot = calibrate(arguments.robot_of_logs(logs, None), [before], 1).robot
    return Recording(
        evidence=Evidence(Simulator(robot, 1), SEGMENT_PREDICTION),
        space=HypothesisSpace.of(ALL_KINDS, robot.anatomy),
        before=before,
        after=after,
    )


def of_other_kinds(recording: Recording, truth: Fault) -> list[Hypothesis]:
    """Returns the best fault of each other kind at a joint, with its severity fitted."""

    def focused(hypotheses: Sequence[Hypothesis]) -> FloatArray:
        total, _, own = three_losses(recording, truth.part, hypotheses)
        return total + own

    found = []
    for kind in recording.space.kinds:
        if kind.is_of_joint and kind.without_severity != truth.kind.without_severity:
            levels = [
                recording.space.canonical([fault])
                for fault in recording.space.coarse_candidates
                if fault.kind == kind and fault.part == truth.part
            ]
            if levels:
                best = levels[int(np.argmin(focused(levels).sum(axis=1)))]
                found.append(with_fitted_severity(best, 0, focused, recording.space))
    return found


def three_losses(
    recording: Recording, joint: str, hypotheses: Sequence[Hypothesis]
) -> list[FloatArray]:
    """Returns the loss, the loss with the mean of all hinges, and that of a joint, ``(n, pieces)``.

    Unknown losses of hinges count as 0.
    """
    hinges = np.nan_to_num(recording.joints.damaged(hypotheses)).mean(axis=2)
    total = recording.evidence.losses(hypotheses, [recording.after])
    return [total, total + hinges, np.nan_to_num(recording.joints.of(joint, hypotheses))]


if __name__ == "__main__":
    main()
