"""A journal that keeps a recovery in memory, for tests of the algorithm alone."""

from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.physical.interface import PhysicalRobot
from selfmodel.recovery.database import Database
from selfmodel.robot.robot import Robot
from selfmodel.trials.behaviour import collect
from selfmodel.trials.trial import Trial, TrialPlan


class MemoryJournal:
    """Keeps trials and diagnoses of one robot; see ``selfmodel.recovery.database.Journal``."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._database = Database()

    def record(self, physical: PhysicalRobot, plan: TrialPlan) -> Trial:
        """Runs a trial and keeps it."""
        samples = physical.run(plan.controller, plan.steps)
        behaviour = collect(self._robot.anatomy.names, samples)
        trial = Trial(plan, self._robot.name, behaviour, plan.name)
        self._database = Database((*self._database.trials, trial), self._database.diagnoses)
        return trial

    def note(self, diagnosis: Diagnosis) -> None:
        """Keeps a diagnosis."""
        self._database = Database(self._database.trials, (*self._database.diagnoses, diagnosis))

    def read(self) -> Database:
        """Returns what was kept."""
        return self._database
