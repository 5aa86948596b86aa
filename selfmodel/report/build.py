"""The report of a subject: its scene and its sections."""

from typing import Any

import numpy as np

from selfmodel.report.document import Report, Section
from selfmodel.report.headline import details, headline
from selfmodel.report.motions import Motion, TrialMotions, motions_as_json
from selfmodel.report.rollouts import Rollout, TrialRollouts, rollouts_of
from selfmodel.report.scene import geometry_of
from selfmodel.report.sections.calibration import calibration_section
from selfmodel.report.sections.gait import gait_section
from selfmodel.report.sections.hypotheses import hypotheses_section
from selfmodel.report.sections.residual import residual_section
from selfmodel.report.sections.searches import searches_section
from selfmodel.report.sections.separation import separation_section
from selfmodel.report.sections.trials import trials_section
from selfmodel.report.subject import TITLE, Subject


def report_of(subject: Subject) -> Report:
    """Returns the report of trials and their diagnoses."""
    rolled = rollouts_of(subject)
    found: list[Section | None] = [
        trials_section(subject, rolled),
        hypotheses_section(subject),
        residual_section(subject),
        separation_section(subject),
        searches_section(subject.searches),
        calibration_section(subject),
        gait_section(subject, rolled),
    ]
    return Report(
        title=TITLE.format(robot=subject.robot.name, name=subject.title),
        headline=headline(subject),
        verdict=details(subject),
        sections=tuple(section for section in found if section is not None),
        scene=_scene(subject, rolled),
        made_with=subject.made_with,
    )


def _scene(subject: Subject, rolled: tuple[TrialRollouts, ...]) -> dict[str, Any]:
    shots = []
    for one in rolled:
        first = one.rollouts[0]
        change = subject.change_of(one.trial)
        shots.append(
            TrialMotions(
                name=one.name,
                motions=(
                    Motion("measured", first.hypothesis, one.trial.behaviour),
                    *(
                        Motion(each.name, each.hypothesis, each.behaviour)
                        for each in one.rollouts
                        if not each.diverged and _is_finite(each)
                    ),
                ),
                mark=None if change is None else change[0],
            )
        )
    return {**geometry_of(subject.robot), "shots": motions_as_json(subject.robot, shots)}


def _is_finite(rolled: Rollout) -> bool:
    return bool(np.isfinite(rolled.behaviour["joint_positions"]).all())
