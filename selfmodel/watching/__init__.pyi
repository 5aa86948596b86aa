from .finding import Finding as Finding, Rated as Rated
from .watch import Watch as Watch
