"""Hypothesis profile: no deadline (a first call compiles a kernel); fixed examples in CI."""

import os

from hypothesis import settings

settings.register_profile("thumper", deadline=None, derandomize="CI" in os.environ)
settings.load_profile("thumper")
