"""Parameters of compensators, estimators and admittance control chosen for a joint, and checked over what is not known of it."""

from backdrive.tune.facts import Facts as Facts
from backdrive.tune.facts import facts_of as facts_of
from backdrive.tune.goals import GOALS as GOALS
from backdrive.tune.propose import tune as tune
from backdrive.tune.tuning import Tuning as Tuning
from backdrive.tune.tuning_file import load_tunings as load_tunings
from backdrive.tune.tuning_file import save_tunings as save_tunings
