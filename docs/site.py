"""Hooks of the site (mkdocs.yml): the page of the Python interface is made from docstrings, and links that lead out of
docs/ become addresses in the repository.

``MOTET_HOME`` is the repository's address, as in hatch_build.py. Without it these links are only text. A link to a
file that does not exist fails a strict build, like every broken link within docs/.
"""

import logging
import os
import posixpath
import re
import runpy
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

LOG = logging.getLogger("mkdocs.hooks.site")
ROOT = Path(__file__).parents[1]
HOME = os.environ.get("MOTET_HOME", "").rstrip("/")


def on_files(files: Files, config: MkDocsConfig) -> None:
    """Adds reference/api.md."""
    text = runpy.run_path(str(ROOT / "docs/reference/api.py"))["page"]()
    files.append(File.generated(config, "reference/api.md", content=text))


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """The text of a page before mkdocs reads its links."""
    folder = posixpath.dirname(f"docs/{page.file.src_uri}")

    def link(match: re.Match[str]) -> str:
        text, target = match.groups()
        path = posixpath.normpath(posixpath.join(folder, target.partition("#")[0]))
        if path.startswith("docs/"):
            return match[0]
        if not (ROOT / path).exists():
            LOG.warning("%s links to %s, which does not exist", page.file.src_uri, path)
        return f"[{text}]({HOME}/blob/main/{path})" if HOME else text

    return re.sub(r"(?<!!)\[([^]]+)\]\((\.\./[^)\s]+)\)", link, markdown)
