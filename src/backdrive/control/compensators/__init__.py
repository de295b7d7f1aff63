"""Friction compensators: torque to add so that a joint moves as if it had little friction."""

from backdrive.control.compensators.catalog import alg_fc as alg_fc
from backdrive.control.compensators.catalog import alg_fc2 as alg_fc2
from backdrive.control.compensators.catalog import aung as aung
from backdrive.control.compensators.catalog import by_law as by_law
from backdrive.control.compensators.catalog import disturbance_observer as disturbance_observer
from backdrive.control.compensators.catalog import impulsive as impulsive
from backdrive.control.compensators.catalog import lugre_observer as lugre_observer
from backdrive.control.compensators.catalog import mahvash_okamura as mahvash_okamura
from backdrive.control.compensators.catalog import nothing as nothing
from backdrive.control.compensators.compensator import Compensator as Compensator
from backdrive.control.compensators.dither import Dither as Dither
