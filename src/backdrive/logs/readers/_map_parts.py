"""Parts of a `--map`."""

from __future__ import annotations

import re
from collections.abc import Collection

#: The name of a channel where its part of a --map begins, and what must not be searched for one.
_BEGINS = re.compile(
    r"""(?P<channel>[A-Za-z_]\w*)\s*=|(?P<open>[(\[])|(?P<close>[)\]])|"[^"]*"|'[^']*'|.""", re.DOTALL
)


def parts_of(text: str) -> list[tuple[str, str]]:
    """Return the parts of a --map, each with the name of its channel as the option spells it; none of what is no --map.

    Args:
        text: such as `t=t,q=q1..q6,wrench=(fx,fy,fz,mx,my,mz)`.
    """
    starts: list[tuple[int, str]] = []
    depth = 0
    for match in _BEGINS.finditer(text):
        depth += bool(match["open"]) - bool(match["close"])
        before = text[: match.start()].rstrip()
        if match["channel"] and depth == 0 and before[-1:] in ("", ","):
            starts.append((match.start(), match["channel"]))
    ends = [start for start, _ in starts[1:]] + [len(text)]
    return [
        (channel, text[start:end].strip().rstrip(","))
        for (start, channel), end in zip(starts, ends, strict=True)
    ]


def without_channels(text: str | None, channels: Collection[str]) -> str | None:
    """Return a --map without the parts of some channels; None where nothing is left.

    Args:
        text: such as `t=t,q=q1..q6,wrench=(fx,fy,fz,mx,my,mz)`.
        channels: names as the option spells them.
    """
    if text is None or not (parts := parts_of(text)):
        return text
    return ",".join(part for channel, part in parts if channel not in channels) or None
