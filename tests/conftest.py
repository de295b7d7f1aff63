"""The same random cases in every run, and no deadline: speed is measured in benchmarks/."""

from hypothesis import settings

settings.register_profile("house", deadline=None, derandomize=True, database=None)
settings.load_profile("house")
