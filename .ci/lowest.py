"""Print the lowest versions that pyproject.toml states, one `name==version` a line: a constraints file for pip."""

import re
import sys
import tomllib
from pathlib import Path

project = tomllib.loads((Path(__file__).parent.parent / "pyproject.toml").read_text())["project"]
extras = project["optional-dependencies"]
wanted = [
    *project["dependencies"],
    *(line for extra, lines in extras.items() if extra != "test" for line in lines),
]
lowest: dict[str, str] = {}
for line in sorted({line for line in wanted if not line.startswith(project["name"])}):
    match = re.fullmatch(r"([A-Za-z0-9_.-]+)(?:\[[a-z0-9,]+\])?>=([0-9.]+)", line)
    if match is None:
        sys.exit(f"pyproject.toml: {line!r} states no lowest version")
    name, version = match.groups()
    numbers = tuple(map(int, version.split(".")))
    if name not in lowest or numbers < tuple(map(int, lowest[name].split("."))):  # several extras, one name
        lowest[name] = version
print(*(f"{name}=={version}" for name, version in lowest.items()), sep="\n")
