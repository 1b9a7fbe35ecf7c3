"""Metadata that depends on where the repository is: project URLs, and absolute links in the description on an index."""

import os
import re
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

HOME = "MOTET_HOME"
"""Environment variable with the repository's address, such as https://github.com/OWNER/motet; without it links stay
relative and no URLs are stated."""


class RepositoryMetadata(MetadataHookInterface):
    """``readme`` and ``urls`` of pyproject.toml, which are dynamic."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Fill them in."""
        text, home = (Path(self.root) / "README.md").read_text(encoding="utf-8"), os.environ.get(HOME, "").rstrip("/")
        metadata["readme"] = {"content-type": "text/markdown", "text": absolute(text, home) if home else text}
        metadata["urls"] = urls(home) if home else {}


def absolute(text: str, home: str) -> str:
    """Markdown whose relative links and pictures lead to files of the repository's main branch."""
    text = re.sub(r'src="(?!https?:)([^"]+)"', rf'src="{home}/raw/main/\1"', text)
    text = re.sub(r"(!\[[^]]*\]\()(?!https?:)([^)]+)\)", rf"\1{home}/raw/main/\2)", text)
    return re.sub(r"((?<!!)\[[^]]*\]\()(?!https?:|#)([^)]+)\)", rf"\1{home}/blob/main/\2)", text)


def urls(home: str) -> dict[str, str]:
    """The project's pages."""
    return {
        "Repository": home,
        "Documentation": f"{home}/tree/main/docs",
        "Changelog": f"{home}/blob/main/CHANGELOG.md",
        "Issues": f"{home}/issues",
    }
