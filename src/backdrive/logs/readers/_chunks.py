"""Decompression of bag chunks, limited to their declared size."""

from __future__ import annotations

from backdrive.errors import FileTooLarge, MissingExtra, install
from backdrive.logs.readers.limits import Limits


class ChunkDamage(Exception):
    """A chunk is damaged; the chunks before it can still be read."""


def expand(data: bytes, how: str, declared: int, limits: Limits) -> bytes:
    """Return the chunk's content.

    Args:
        data: as stored.
        how: '' or 'none', 'lz4', 'zstd' or 'bz2'.
        declared: size that the file says the content has [B].
        limits: bounds on that size.

    Raises:
        FileTooLarge: the content is larger than declared or allowed.
        Damaged: it is not what was written, or compressed in an unknown way.
        MissingExtra: the decompressor is not installed.
    """
    if how in ("", "none"):
        return data
    limits.check_size(declared, len(data), "A chunk")
    try:
        if how == "bz2":
            import bz2

            content = bz2.BZ2Decompressor().decompress(data, declared + 1)
        elif how == "lz4":
            import lz4.frame

            content = lz4.frame.LZ4FrameDecompressor().decompress(data, declared + 1)
        elif how == "zstd":
            import zstandard

            stated = zstandard.frame_content_size(data)
            if stated > declared:
                raise FileTooLarge(
                    f"A chunk of {declared} bytes unpacks to {stated}.", remedy="Record it again."
                )
            content = zstandard.ZstdDecompressor().decompress(data, max_output_size=declared)
        else:
            raise ChunkDamage(f"a chunk is compressed with '{how[:40]}', which is not known")
    except ImportError as error:
        raise MissingExtra(
            f"The bag is compressed with {how}, and its decompressor is not installed.",
            remedy=install("ros"),
        ) from error
    except (OSError, ValueError, RuntimeError, EOFError) as error:
        raise ChunkDamage(f"a damaged chunk: {str(error)[:200]}") from error
    except Exception as error:  # zstandard's own error class exists only where it is installed
        if type(error).__module__.startswith("zstandard"):
            raise ChunkDamage(f"a damaged chunk: {str(error)[:200]}") from error
        raise
    if len(content) > declared:
        raise FileTooLarge(f"A chunk declares {declared} bytes and holds more.", remedy="Record it again.")
    return content
