from .database import Database as Database, Journal as Journal
from .events import Event as Event
from .next_trial import (
    NextTrial as NextTrial,
    Situation as Situation,
    by_disagreement as by_disagreement,
    by_repair as by_repair,
)
from .recovery import Recovery as Recovery
from .repair.paper_repair import RepairSearch as RepairSearch
from .repertoire.evaluation import (
    Evaluate as Evaluate,
    simulated_evaluation as simulated_evaluation,
)
from .repertoire.make import (
    Reevaluation as Reevaluation,
    make_repertoire as make_repertoire,
    reevaluate as reevaluate,
)
from .repertoire.repertoire import Repertoire as Repertoire
from .scores.energy import ENERGY as ENERGY
from .scores.fitness import DISPLACEMENT as DISPLACEMENT, Score as Score
from .scores.joint_limits import upright_within as upright_within
