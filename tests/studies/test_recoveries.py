"""Outcomes of recoveries."""

import pytest

from selfmodel.logs.results import TrialResult
from selfmodel.studies.recoveries import outcome_of


def trial(score: float | None, fall: int | None = None) -> TrialResult:
    """A trial with a score in which the robot fell at a step."""
    return TrialResult(log="x.mcap", stage="recovery", score=score, fell_at_step=fall)


@pytest.mark.parametrize(
    ("before", "after", "best", "share", "outcome"),
    [
        (trial(2.0), trial(1.0), trial(1.5), 0.5, "better"),
        (trial(2.0), trial(1.0), trial(0.5), -0.5, "not better"),
        (trial(2.0), trial(1.0), trial(1.0), 0.0, "not better"),
        (trial(-1.0), trial(-3.0), trial(-1.0), 1.0, "better"),  # a cost
        (trial(2.0), trial(1.0), trial(1.9, 7), None, "fell"),
        (trial(2.0), trial(1.91), trial(2.5), None, "no effect"),
        (trial(2.0), trial(2.2), trial(1.0), None, "worse"),  # by the repair
        (trial(2.0), trial(2.2), trial(2.0, 7), None, "worse"),
        (trial(2.0, 5), trial(2.0, 5), trial(3.0), None, "no effect"),
        (trial(2.0), trial(2.2, 5), trial(1.5), None, "better"),  # it stands again
        (trial(2.0), trial(2.2, 5), trial(3.0, 6), None, "fell"),
        (trial(2.0), trial(None), trial(3.0), None, None),
    ],
)
def test_an_outcome_is_the_share_of_the_lost_score_that_was_regained_without_a_fall(
    before: TrialResult, after: TrialResult, best: TrialResult, share: float, outcome: str
):
    assert outcome_of(before, after, best) == (share, outcome)
