from .diagnostics import Level as Level, PartStatus as PartStatus, part_statuses as part_statuses
from .finding import Finding as Finding, Rated as Rated
from .watch import Watch as Watch
