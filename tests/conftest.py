"""How properties are tried: no deadline (a first call compiles a kernel), the same examples each CI run."""

import os

from hypothesis import settings

settings.register_profile("thumper", deadline=None, derandomize="CI" in os.environ)
settings.load_profile("thumper")
