"""One recovery through the Python API: your robot, your comparator, your journal.

Usage: python examples/recover_in_python.py RUN_FOLDER
"""

import sys
from pathlib import Path

from selfmodel.arguments import comparator_choice
from selfmodel.comparators import FORWARD_DISPLACEMENT
from selfmodel.faults.notation import parse
from selfmodel.logs.journal import create_journal
from selfmodel.logs.physical_trial import TrialRunner
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.recovery.recover import RecoveryLoop
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.tasks import ROBOTS


def main(folder: Path) -> None:
    """Recovers a quadruped that lost a leg, with a small budget."""
    robot = ROBOTS["quadruped"].robot()
    truth = parse("break:back_left_shoulder", robot.anatomy)
    settings = Settings(steps=300, trials=2, generations=5).scaled(20)
    journal = create_journal(folder, robot.anatomy, calibrated=False)
    recovery = RecoveryLoop(
        simulator=Simulator(robot, threads=2),
        choose_comparator=comparator_choice(FORWARD_DISPLACEMENT),
        run_trial=TrialRunner(journal.trials, robot, settings),
        journal=journal,
        settings=settings,
        seed=0,
        on_event=lambda _event: None,
    ).run(SimulatedRobot(robot), SimulatedRobot(robot, truth))  # or any PhysicalRobot
    print(f"best explanation: {recovery.diagnosis.best} (the truth: {truth})")
    print(f"{recovery.before:.2f} m, {recovery.after:.2f} m, {recovery.recovered:.2f} m")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(Path(sys.argv[1]))
