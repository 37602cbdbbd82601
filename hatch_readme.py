"""Give the description on a package index links that work there.

With GITHUB_REPOSITORY (`owner/name`, set in its workflows) they lead to the tag of this version.
"""

import os
import runpy
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface


class ReadmeHook(MetadataHookInterface):
    """Adds readme and URLs to the metadata."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Called by hatchling."""
        root = Path(self.root)
        version = runpy.run_path(str(root / "host/thumper/common/version.py"))["__version__"]
        absolute = runpy.run_path(str(root / "scripts/index_readme.py"))["absolute"]
        repository = os.environ.get("GITHUB_REPOSITORY", "")
        source = f"https://github.com/{repository}" if repository else ""
        text = absolute((root / "README.md").read_text(), source and f"{source}/{{kind}}/v{version}")
        metadata["readme"] = {"content-type": "text/markdown", "text": text}
        if source:
            metadata["urls"] = {"Source": source, "Changes": f"{source}/blob/v{version}/CHANGELOG.md"}
