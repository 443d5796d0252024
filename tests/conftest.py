"""Settings that all tests share."""

from hypothesis import settings

# a law does not fail because the machine is busy
settings.register_profile("project", deadline=None, print_blob=True)
settings.load_profile("project")
