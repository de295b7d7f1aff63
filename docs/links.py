"""Links to files outside `docs`: on the site they are named, not followed, since it is built without them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

DOCS = Path(__file__).resolve().parent
LINK = re.compile(r"(?<!!)\[([^\]]*)\]\(([^)#:\s]+)(#[^)\s]*)?\)")


def on_page_markdown(markdown: str, *, page: Any, **_: Any) -> str:
    """Return a page in which a link to a file outside `docs` is its text and the file's path.

    Raises:
        FileNotFoundError: there is no such file in the repository either.
    """
    here = DOCS / Path(page.file.src_uri).parent

    def replace(match: re.Match) -> str:
        target = (here / match[2]).resolve()
        if target.is_relative_to(DOCS):
            return match[0]
        if not target.exists():
            raise FileNotFoundError(f"{page.file.src_uri} links to {match[2]}, which is not there.")
        return f"{match[1]} (`{target.relative_to(DOCS.parent)}`)"

    return LINK.sub(replace, markdown)
