from .behaviour import (
    Behaviour as Behaviour,
    Sample as Sample,
    collect as collect,
    forward_displacement as forward_displacement,
)
from .signals import SIGNALS as SIGNALS, Names as Names, Signal as Signal
from .trial import Stage as Stage, Trial as Trial, TrialPlan as TrialPlan
