"""The ablation: every comparator diagnoses from the same trials, on a grid of runs."""

from selfmodel.experiments.ablation.ablate import ablate
from selfmodel.experiments.ablation.plan import Ablation
from selfmodel.experiments.ablation.results import Results, collect, write_results
from selfmodel.experiments.ablation.rows import Row

__all__ = ["Ablation", "Results", "Row", "ablate", "collect", "write_results"]
