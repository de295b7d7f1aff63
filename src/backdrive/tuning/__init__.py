"""Choice of the parameters of compensators, estimators and admittance control for a joint, checked over its uncertainty."""

from backdrive.tuning.facts import Facts as Facts
from backdrive.tuning.facts import facts_of as facts_of
from backdrive.tuning.goals import GOALS as GOALS
from backdrive.tuning.propose import tune as tune
from backdrive.tuning.tuning import Tuning as Tuning
from backdrive.tuning.tuning_file import load_tunings as load_tunings
from backdrive.tuning.tuning_file import save_tunings as save_tunings
