"""The record of a run: its signals, its plan, and arithmetic on the signals."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from selfmodel.trials.behaviour import (
        SIGNALS as SIGNALS,
        Behaviour as Behaviour,
        Names as Names,
        Sample as Sample,
        Signal as Signal,
        collect as collect,
        forward_displacement as forward_displacement,
    )
    from selfmodel.trials.trial import Stage as Stage, Trial as Trial, TrialPlan as TrialPlan
else:
    __getattr__, __dir__, __all__ = lazy_loader.attach(
        __name__,
        submod_attrs={
            "behaviour": [
                "SIGNALS",
                "Behaviour",
                "Names",
                "Sample",
                "Signal",
                "collect",
                "forward_displacement",
            ],
            "trial": ["Stage", "Trial", "TrialPlan"],
        },
    )
