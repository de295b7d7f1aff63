"""Defaults of MJCF: attributes of an element that come from its class."""

from __future__ import annotations

from typing import Any

from backdrive.errors import ReadError

MAIN = "main"


class Defaults:
    """The `<default>` classes of a file: class -> tag -> attributes, those of the class above included."""

    def __init__(self, root: Any, where: str):
        """Read the classes.

        Args:
            root: element `<mujoco>`.
            where: what to call the file in messages.

        Raises:
            ReadError: a class has no name.
        """
        self._where = where
        self._of: dict[str, dict[str, dict[str, str]]] = {MAIN: {}}
        waiting = [(node, "") for node in root.findall("default")]
        while waiting:
            node, above = waiting.pop(0)
            name = node.get("class") or ("" if above else MAIN)
            if not name:
                raise ReadError(f"{where}: a <default> inside '{above}' has no class.", remedy="Name it.")
            tags = {tag: dict(x) for tag, x in self._of.get(above, self._of[MAIN]).items()}
            for child in node:
                if child.tag == "default":
                    waiting.append((child, name))
                else:
                    tags[child.tag] = tags.get(child.tag, {}) | dict(child.attrib)
            self._of[name] = tags

    def attributes(self, node: Any, class_above: str | None) -> dict[str, str]:
        """Return the attributes of an element with those of its class.

        Args:
            node: the element.
            class_above: `childclass` of the nearest body or frame that states one.

        Raises:
            ReadError: there is no such class.
        """
        name = node.get("class") or class_above or MAIN
        if name not in self._of:
            raise ReadError(
                f"{self._where}: <{node.tag}> is of class '{name}', which is declared nowhere.",
                remedy=f"One of {', '.join(self._of)}.",
            )
        return self._of[name].get(node.tag, {}) | dict(node.attrib)
