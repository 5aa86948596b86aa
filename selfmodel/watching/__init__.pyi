from .diagnostics import Level as Level, PartStatus as PartStatus, part_statuses as part_statuses
from .finding import Finding as Finding, Rated as Rated
from .record import WatchRecord as WatchRecord
from .watch import Watch as Watch
