from .signals import SIGNALS as SIGNALS, Names as Names, Signal as Signal
from .trajectory import (
    Sample as Sample,
    Trajectory as Trajectory,
    collect as collect,
    forward_displacement as forward_displacement,
)
from .trial import Stage as Stage, Trial as Trial, TrialPlan as TrialPlan
