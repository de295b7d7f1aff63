"""From logs to a friction model: `identify`, and `validate` on logs that the fit did not see."""

from backdrive.identification.pipeline import identify as identify
from backdrive.identification.result import Curve as Curve
from backdrive.identification.result import Identification as Identification
from backdrive.identification.result import JointEvidence as JointEvidence
from backdrive.identification.result import Samples as Samples
from backdrive.identification.validate import validate as validate
from backdrive.identification.validate import validate_motion as validate_motion
from backdrive.identification.validation import Validation as Validation
