"""Each figure and table of the thesis as a program: data, numbers beside what the thesis states, and a verdict."""

from backdrive.experiments.outcome import Claim as Claim
from backdrive.experiments.outcome import Outcome as Outcome
