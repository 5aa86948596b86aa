"""The ablation: every comparator diagnoses from the same trials, on a grid of runs."""

from selfmodel.cli.ablation.ablate import ablate
from selfmodel.cli.ablation.plan import Ablation
from selfmodel.cli.ablation.results import Results, collect, write_results
from selfmodel.cli.ablation.rows import Row

__all__ = ["Ablation", "Results", "Row", "ablate", "collect", "write_results"]
