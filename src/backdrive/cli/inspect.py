"""Placeholder."""


def command() -> None:
    """Not built yet."""
