"""Friction compensators: torque to add so that a joint moves as if it had little friction."""

from backdrive.compensate.catalog import alg_fc as alg_fc
from backdrive.compensate.catalog import alg_fc2 as alg_fc2
from backdrive.compensate.catalog import aung as aung
from backdrive.compensate.catalog import by_law as by_law
from backdrive.compensate.catalog import disturbance_observer as disturbance_observer
from backdrive.compensate.catalog import impulsive as impulsive
from backdrive.compensate.catalog import lugre_observer as lugre_observer
from backdrive.compensate.catalog import mahvash_okamura as mahvash_okamura
from backdrive.compensate.catalog import nothing as nothing
from backdrive.compensate.compensator import Compensator as Compensator
from backdrive.compensate.dither import Dither as Dither
