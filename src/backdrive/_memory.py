"""Freed memory that a process keeps for its next arrays."""

from __future__ import annotations

from functools import cache

import numpy as np

LARGEST = 1 << 23  # size of the largest array whose memory is kept [byte]


@cache
def keep_free_memory() -> None:
    """Let the C library keep the memory of freed arrays of up to 8 MB.

    Otherwise glibc returns that of each array above 128 kB to the system, which hands it out again page by page, emptied. Once
    a larger piece was freed, it keeps pieces of up to that size, and at most twice as much without use (`M_MMAP_THRESHOLD` in
    mallopt(3)). The piece is never written, so it takes no memory itself. Where the C library is another one, this has no effect.
    """
    np.empty(LARGEST, dtype=np.uint8)
