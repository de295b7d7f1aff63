"""The thesis' figures and tables as programs, one file each, with data, claims, verdicts and picture; and an HTML book of all
results.
"""

from backdrive.thesis.outcome import Claim as Claim
from backdrive.thesis.outcome import Outcome as Outcome
