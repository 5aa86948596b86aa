from .database import Database as Database, Journal as Journal
from .energy import ENERGY as ENERGY
from .events import Event as Event
from .fitness import DISPLACEMENT as DISPLACEMENT, Score as Score
from .next_trial import (
    NextTrial as NextTrial,
    Situation as Situation,
    by_disagreement as by_disagreement,
    by_repair as by_repair,
)
from .recovery import Recovery as Recovery
from .repair import RepairSearch as RepairSearch
