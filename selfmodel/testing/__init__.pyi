from .diagnosis import (
    check_comparator as check_comparator,
    check_fault_kind as check_fault_kind,
    shown as shown,
)
from .recovery import (
    check_design as check_design,
    check_next_trial as check_next_trial,
    check_score as check_score,
    check_search as check_search,
)
