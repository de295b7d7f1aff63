"""The thesis' figures and tables as programs, one file each: data, claims with verdicts, picture. Bound into a book."""

from backdrive.thesis.outcome import Claim as Claim
from backdrive.thesis.outcome import Outcome as Outcome
