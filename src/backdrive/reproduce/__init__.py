"""Run the thesis' experiments, draw them, bind the book."""

from backdrive.reproduce.catalog import ENTRIES as ENTRIES
from backdrive.reproduce.catalog import Entry as Entry
from backdrive.reproduce.catalog import choose as choose
from backdrive.reproduce.run import Result as Result
from backdrive.reproduce.run import run_all as run_all
