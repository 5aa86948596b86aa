from .api import (
    calibrate as calibrate,
    diagnose as diagnose,
    evolve as evolve,
    export_diagnosis as export_diagnosis,
    recover as recover,
    replay as replay,
)
from .arguments import load_robot as load_robot, parse_hypothesis as parse_hypothesis
from .controllers.controller import Controller as Controller
from .diagnosis.comparator import Comparator as Comparator
from .diagnosis.diagnosis import Diagnosis as Diagnosis
from .faults.hypothesis import Hypothesis as Hypothesis
from .faults.kind import FaultKind as FaultKind
from .faults.registry import ALL_KINDS as ALL_KINDS, PAPER_KINDS as PAPER_KINDS
from .logs.reader import read_log as read_log
from .physical.environment import EnvironmentRobot as EnvironmentRobot
from .physical.interface import PhysicalRobot as PhysicalRobot
from .recording import (
    Episode as Episode,
    evaluate as evaluate,
    load_policy as load_policy,
    record as record,
    run_trial as run_trial,
    simulated_robot as simulated_robot,
    write_log as write_log,
)
from .recovery.result import Recovery as Recovery
from .robot.robot import Robot as Robot
from .settings import RepairSettings as RepairSettings, Settings as Settings
from .simulation.simulator import Simulator as Simulator
from .studies.rows import load as load
from .studies.study import Study as Study
from .testing import (
    check_comparator as check_comparator,
    check_design as check_design,
    check_fault_kind as check_fault_kind,
    check_next_trial as check_next_trial,
    check_score as check_score,
    check_search as check_search,
)
from .testing.contract import ContractError as ContractError
from .trials.trajectory import Trajectory as Trajectory
from .trials.trial import Trial as Trial
from .version import __version__ as __version__
from .watching.watch import Watch as Watch
