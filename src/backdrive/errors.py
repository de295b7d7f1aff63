"""Every error that backdrive raises on purpose.

The first sentence of each error names the value and its fault, the second one a remedy. The command line converts the class
to an exit code, so a script can distinguish a bad result from a bad file.
"""

from __future__ import annotations

from importlib import import_module
from os import PathLike
from typing import Any

from backdrive._options import as_arguments
from backdrive._visible import visible


class BackdriveError(Exception):
    """The root of all errors of this package.

    Its `str` names keyword arguments where `message` and `remedy` name options of the command line.

    Args:
        message: the fault, with the invalid value.
        remedy: what the user can do about it.
        data: the offending values themselves, for programs.
    """

    exit_code = 4

    def __init__(self, message: str, *, remedy: str = "", **data: object):
        message, remedy = visible(message), visible(remedy)  # names in them may be a hostile file's
        self.message = message
        self.remedy = remedy
        self.data = data
        super().__init__(as_arguments(self.text))

    @property
    def text(self) -> str:
        """Message and remedy as the command line prints them."""
        return f"{self.message} {self.remedy}".rstrip()

    def __reduce__(self):  # keyword-only arguments must survive the way back from a child process
        return (_rebuild, (type(self), self.message, self.remedy, self.data))


def _rebuild(cls: type[BackdriveError], message: str, remedy: str, data: dict) -> BackdriveError:
    return cls(message, remedy=remedy, **data)


class BackdriveWarning(UserWarning):
    """A warning that something works, but not optimally or not safely; the sentence names a remedy."""


class InvalidInput(BackdriveError, ValueError):
    """An argument has the wrong shape, sign, range or unit."""

    exit_code = 2


class WriteError(InvalidInput):
    """A file cannot be written: its place, its kind, its protection or a full disk forbids it."""


class UnknownName(InvalidInput):
    """A name is not in a catalogue; the message lists the known ones."""


class MappingError(InvalidInput):
    """A `--map` expression or a channel name does not fit the file."""


class OldName(BackdriveError, ImportError):
    """A module or name was renamed; the message states the new name."""

    exit_code = 2


class MissingExtra(BackdriveError, ImportError):
    """An optional dependency is not installed; the remedy names the extra."""

    exit_code = 2


def check_type(value: Any, kind: type | tuple[type, ...], what: str, remedy: str) -> None:
    """Refuse an argument of a wrong type.

    Args:
        value: what was passed.
        kind: class that is accepted, or several.
        what: its name in a sentence, such as `friction model`.
        remedy: what to pass.

    Raises:
        InvalidInput: the value is of another type.
    """
    if not isinstance(value, kind):
        name = type(value).__name__
        article = "An" if name[0] in "AEIOUaeiou" or name == "ndarray" else "A"
        raise InvalidInput(f"{article} {name} is no {what}.", remedy=remedy)


def check_path(value: Any) -> None:
    """Refuse a value that names no file; see `check_type`."""
    check_type(value, (str, PathLike), "path", "Pass the name of a file, as a string or a Path.")


def install(extra: str) -> str:
    """Return how to install an extra, as a remedy: from where the package is installed, or from a checkout."""
    return f'Run: pip install "backdrive[{extra}]", or in a checkout of backdrive: pip install ".[{extra}]".'


def require(module: str, purpose: str, extra: str) -> Any:
    """Return a module of an optional dependency, or say how to install it.

    Args:
        module: its name.
        purpose: what needs it, with the verb, such as `Reading Parquet needs`.
        extra: of this package, which brings it.

    Raises:
        MissingExtra: it is not installed.
    """
    try:
        return import_module(module)
    except ImportError as error:
        package = module.partition(".")[0]
        raise MissingExtra(f"{purpose} {package}, which is not installed.", remedy=install(extra)) from error


class ReadError(BackdriveError):
    """A file cannot be read as what it claims to be."""

    exit_code = 3


class UnknownFormat(ReadError):
    """No reader knows this kind of file."""


class IncompleteFile(ReadError):
    """The file ends before its content does."""


class FileTooLarge(ReadError):
    """The file declares more data than the limits allow."""


class ForbiddenContent(ReadError):
    """The file asks for something no log needs: links to other files, executable content."""


class ReaderCrash(ReadError):
    """The process that parsed the file died."""


class ReaderTimeout(ReadError):
    """Parsing the file took longer than allowed."""


class ModelFileError(ReadError):
    """A model file is damaged or of an unknown kind; the message says where."""


class UnhealthyLog(BackdriveError):
    """A log has a fault that would spoil the result."""

    exit_code = 1


class NotIdentifiable(BackdriveError):
    """The data do not determine what was asked for."""

    exit_code = 1


class LimitWarning(BackdriveWarning):
    """A torque limit is so large that the watch cannot stop a runaway in time."""


class ExtrapolationWarning(BackdriveWarning):
    """A model was evaluated outside the range of its data."""


class NegativeFrictionWarning(BackdriveWarning):
    """A model's friction drives the motion instead of resisting it."""
