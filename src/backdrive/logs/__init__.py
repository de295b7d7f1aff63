"""Logs of joints: the data, filters, readers of files, checks of health."""

from backdrive.logs.log import Drive as Drive
from backdrive.logs.log import Joint as Joint
from backdrive.logs.log import Log as Log
from backdrive.logs.log import Source as Source
