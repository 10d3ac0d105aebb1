from .claims import Claim as Claim
from .claims import Decision as Decision
from .claims import Outcome as Outcome
from .claims import check_claims as check_claims
from .report import Report as Report
from .report import Section as Section
from .report import write_report as write_report
from .results import StudyResults as StudyResults
