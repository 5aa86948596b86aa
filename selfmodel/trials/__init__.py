"""The record of a run: its signals, its plan, and arithmetic on the signals."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from selfmodel.trials.behaviour import (
        Behaviour as Behaviour,
        Sample as Sample,
        collect as collect,
        forward_displacement as forward_displacement,
    )
    from selfmodel.trials.signals import SIGNALS as SIGNALS, Names as Names, Signal as Signal
    from selfmodel.trials.trial import Stage as Stage, Trial as Trial, TrialPlan as TrialPlan
else:
    __getattr__, __dir__, __all__ = lazy_loader.attach(
        __name__,
        submod_attrs={
            "behaviour": ["Behaviour", "Sample", "collect", "forward_displacement"],
            "signals": ["SIGNALS", "Names", "Signal"],
            "trial": ["Stage", "Trial", "TrialPlan"],
        },
    )
