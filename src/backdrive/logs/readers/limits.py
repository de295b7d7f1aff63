"""The resources that a log file may require before it is refused."""

from __future__ import annotations

from dataclasses import dataclass

from backdrive.errors import FileTooLarge, InvalidInput

GIB = 1024**3
MIB = 1024**2

#: Time beyond the expected reading time after which a file is refused [s].
GRACE = 5.0


@dataclass(frozen=True, kw_only=True)
class Limits:
    """What the parser of an untrusted file may use.

    Attributes:
        max_file_bytes: size of the file itself [B].
        max_bytes: what the file declares to hold once decoded [B].
        max_memory: address space of the parsing process [B]; not enforced where the system has no such limit (macOS).
        max_ratio: decoded bytes per file byte [1]; only asked above `ratio_floor`.
        ratio_floor: decoded size below which any compression ratio is fine [B].
        max_columns: columns, variables or joints in one file [1].
        max_seconds: wall-clock limit of one file [s]; None reckons it from the file's size.
        slowest: reading speed on a slow machine, for that limit [B/s].
    """

    max_file_bytes: int = 16 * GIB
    max_bytes: int = 2 * GIB
    max_memory: int = 2 * GIB
    max_ratio: float = 250.0
    ratio_floor: int = 64 * MIB
    max_columns: int = 4096
    max_seconds: float | None = None
    slowest: float = 5e6

    def __post_init__(self):
        for name in ("max_file_bytes", "max_bytes", "max_memory", "max_ratio", "max_columns", "slowest"):
            if not getattr(self, name) > 0:
                raise InvalidInput(
                    f"Limits.{name} is {getattr(self, name)}.", remedy="Give a positive number."
                )
        if self.max_seconds is not None and not self.max_seconds > 0:
            raise InvalidInput(
                f"Limits.max_seconds is {self.max_seconds}.", remedy="Give a positive time, or None."
            )

    def seconds_for(self, size: int) -> float:
        """Return the wall-clock limit for a file of `size` bytes [s]: expected reading time plus 2 s."""
        return self.max_seconds if self.max_seconds is not None else 0.5 + size / self.slowest + GRACE

    def memory_for(self, size: int) -> int:
        """Return what parsing a file of `size` bytes may add to the process [B]."""
        return int(min(self.max_memory, 256 * MIB + 40 * size))

    def check_size(self, declared: int, size: int, what: str) -> None:
        """Refuse a declared size before anything of that size is reserved.

        Args:
            declared: decoded size that the file claims [B].
            size: size of the file [B].
            what: noun for the message.

        Raises:
            FileTooLarge: beyond `max_bytes`, or beyond `max_ratio` times the file.
        """
        if declared > self.max_bytes:
            raise FileTooLarge(
                f"{what} declares {declared / MIB:.0f} MiB, more than the limit of {self.max_bytes / MIB:.0f} MiB.",
                remedy="If you trust the file, read it in Python with limits=Limits(max_bytes=..., max_memory=...).",
            )
        if declared > self.ratio_floor and declared > self.max_ratio * max(size, 1):
            raise FileTooLarge(
                f"{what} declares {declared / MIB:.0f} MiB in a file of {size / MIB:.2f} MiB "
                f"({declared / max(size, 1):.0f} times its size), as a decompression bomb does.",
                remedy="If you trust the file, read it in Python with limits=Limits(max_ratio=...).",
            )

    def check_count(self, count: int, what: str) -> None:
        """Refuse a file with too many columns.

        Raises:
            FileTooLarge: beyond `max_columns`.
        """
        if count > self.max_columns:
            raise FileTooLarge(
                f"The file holds {count} {what}, more than the limit of {self.max_columns}.",
                remedy="If you trust the file, read it in Python with limits=Limits(max_columns=...).",
            )
