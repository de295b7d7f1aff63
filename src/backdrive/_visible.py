"""Display of untrusted text (names of files and columns, options): control characters cannot reach the terminal."""

from __future__ import annotations

import re

#: Characters that are escaped: controls (C0, DEL, C1), line and paragraph separators, format and bidirectional characters,
#: and surrogates, which have no encoding. Spaces that Python does not count as printable are harmless.
_HIDDEN = re.compile(
    "[\x00-\x1f\x7f-\x9f\xad\u0600-\u0605\u061c\u06dd\u070f\u180e\u200b-\u200f\u2028-\u202e\u2060-\u206f"
    "\ud800-\udfff\ufeff\ufff9-\ufffb\U000110bd\U0001bca0-\U0001bca3\U0001d173-\U0001d17a\U000e0000-\U000e007f]"
)


def visible(text: object, keep: str = "") -> str:
    r"""Return text with whatever would act on a terminal or hide in it quoted: an escape byte as \x1b, a bidi mark as \u202e.

    Args:
        text: anything; its `str`.
        keep: characters that are left alone, such as the line feeds of a text of one's own.
    """
    return _HIDDEN.sub(lambda match: match[0] if match[0] in keep else _quote(match[0]), str(text))


def _quote(character: str) -> str:
    short = {"\n": r"\n", "\r": r"\r", "\t": r"\t"}.get(character)
    code = ord(character)
    return short or (
        f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"
    )
