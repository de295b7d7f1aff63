"""The engine: friction of any law along given motions, and forward dynamics of single axes, with many parameter sets in one
compiled call.
"""

from backdrive.engine.drives import DriveModel as DriveModel
from backdrive.engine.forward import Axis as Axis
from backdrive.engine.forward import Motions as Motions
from backdrive.engine.forward import forward as forward
from backdrive.engine.series import Lanes as Lanes
from backdrive.engine.series import rollout as rollout
from backdrive.engine.series import unlike as unlike
from backdrive.engine.servo import Servo as Servo
