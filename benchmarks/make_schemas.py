"""Write the JSON schemas that the package ships: src/backdrive/model/model.schema.json and src/backdrive/tuning/tuning.schema.json.

python benchmarks/make_schemas.py
"""

from __future__ import annotations

from pathlib import Path

import backdrive
from backdrive.model import document
from backdrive.tuning import tuning_file

ROOT = Path(backdrive.__file__).parent


def main() -> None:
    """Write both."""
    (ROOT / "model" / "model.schema.json").write_text(document.schema())
    (ROOT / "tuning" / "tuning.schema.json").write_text(tuning_file.schema())


if __name__ == "__main__":
    main()
