"""A step of the build: stores the commit in the package, so that an installed one names it.

`pip install .` copies the package away from its git repository. An editable installation needs no
such file: it runs in the repository.
"""

import runpy
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

STORED = "swarm_mj/COMMIT"  # in the archive; `swarm_mj.system.packages` reads it


class StoreCommit(BuildHookInterface[Any]):
    """Adds a file with the commit to wheels and source archives."""

    PLUGIN_NAME = "custom"

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Add the file, unless the commit is unknown or was stored before, in a source archive."""
        root = Path(self.root)
        # The build has no NumPy, so the package itself cannot be imported.
        commit = runpy.run_path(str(root / "swarm_mj" / "system" / "packages.py"))["commit"]()
        if version == "editable" or commit is None or (root / STORED).exists():
            return
        self._folder = tempfile.TemporaryDirectory()
        file = Path(self._folder.name, "COMMIT")
        file.write_text(f"{commit}\n", encoding="utf-8")
        build_data["force_include"][str(file)] = STORED

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:  # noqa: ARG002
        """Remove what was made for the archive."""
        folder: tempfile.TemporaryDirectory[str] | None = getattr(self, "_folder", None)
        if folder is not None:
            folder.cleanup()
