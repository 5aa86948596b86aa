from .map_elites import (
    Evaluate as Evaluate,
    make_repertoire as make_repertoire,
    reevaluate as reevaluate,
    simulated_evaluation as simulated_evaluation,
)
from .next_trial import by_disagreement as by_disagreement
from .recover import (
    NextTrial as NextTrial,
    RecoveryLoop as RecoveryLoop,
    by_repair as by_repair,
)
from .repair import RepairSearch as RepairSearch
from .repertoire import Repertoire as Repertoire
from .result import Event as Event, Recovery as Recovery
from .scores import (
    DISPLACEMENT as DISPLACEMENT,
    ENERGY as ENERGY,
    STEPS as STEPS,
    STRAIGHT as STRAIGHT,
    Score as Score,
    upright_within as upright_within,
)
from .tracking import (
    Reference as Reference,
    following as following,
    tracking as tracking,
)
