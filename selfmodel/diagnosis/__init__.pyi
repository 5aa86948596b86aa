from .comparator import Comparator as Comparator, PreparedTrial as PreparedTrial
from .comparator_contract import check_comparator as check_comparator, shown as shown
from .diagnose import DiagnosticSearch as DiagnosticSearch
from .diagnosis import Candidate as Candidate, Diagnosis as Diagnosis, Verdict as Verdict
from .kind_contract import check_fault_kind as check_fault_kind
