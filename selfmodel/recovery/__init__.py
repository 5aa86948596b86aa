"""The recovery loop: repair EA, choice of the next trial, database and journal."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from selfmodel.recovery.database import Database as Database, Journal as Journal
    from selfmodel.recovery.events import Event as Event
    from selfmodel.recovery.fitness import DISPLACEMENT as DISPLACEMENT, Score as Score
    from selfmodel.recovery.next_trial import (
        NextTrial as NextTrial,
        Situation as Situation,
        by_disagreement as by_disagreement,
        by_repair as by_repair,
    )
    from selfmodel.recovery.recover import Recovery as Recovery
    from selfmodel.recovery.repair import RepairSearch as RepairSearch
else:
    __getattr__, __dir__, __all__ = lazy_loader.attach(
        __name__,
        submod_attrs={
            "database": ["Database", "Journal"],
            "events": ["Event"],
            "fitness": ["DISPLACEMENT", "Score"],
            "next_trial": ["NextTrial", "Situation", "by_disagreement", "by_repair"],
            "recover": ["Recovery"],
            "repair": ["RepairSearch"],
        },
    )
