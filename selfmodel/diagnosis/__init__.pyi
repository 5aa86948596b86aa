from .comparator import Comparator as Comparator, PreparedTrial as PreparedTrial
from .diagnose import DiagnosticSearch as DiagnosticSearch
from .diagnosis import Candidate as Candidate, Diagnosis as Diagnosis, Verdict as Verdict
