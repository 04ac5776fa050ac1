"""Every search draws the same examples everywhere, and takes the time that a shared machine gives it."""

from hypothesis import settings

settings.register_profile("grouser", deadline=None, derandomize=True)
settings.load_profile("grouser")
