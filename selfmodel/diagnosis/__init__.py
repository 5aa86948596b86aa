"""The diagnostic EA: which hypothesis explains the logged trials."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from selfmodel.diagnosis.comparator import (
        Comparator as Comparator,
        PreparedTrial as PreparedTrial,
    )
    from selfmodel.diagnosis.comparator_contract import (
        check_comparator as check_comparator,
        shown as shown,
    )
    from selfmodel.diagnosis.diagnose import DiagnosticSearch as DiagnosticSearch
    from selfmodel.diagnosis.diagnosis import (
        Candidate as Candidate,
        Diagnosis as Diagnosis,
        Verdict as Verdict,
    )
    from selfmodel.diagnosis.kind_contract import check_fault_kind as check_fault_kind
else:
    __getattr__, __dir__, __all__ = lazy_loader.attach(
        __name__,
        submod_attrs={
            "comparator": ["Comparator", "PreparedTrial"],
            "comparator_contract": ["check_comparator", "shown"],
            "diagnose": ["DiagnosticSearch"],
            "diagnosis": ["Candidate", "Diagnosis", "Verdict"],
            "kind_contract": ["check_fault_kind"],
        },
    )
