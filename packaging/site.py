"""Hook of MkDocs: the site has the README as its front page, and every file of the project that documents link to."""

from __future__ import annotations

import posixpath
import re
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files, InclusionLevel
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parents[1]
#: Folder of the site for files from outside of docs/.
OTHERS = "repository"
_LINK = re.compile(r"(?<=\]\()([^)#\s]+)(?=[)#])")
_CODE = re.compile(r"^```.*?^```|`[^`\n]*`", re.MULTILINE | re.DOTALL)
_EXTERNAL = re.compile(r"[a-z]+:", re.IGNORECASE)


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Headings have the anchors that GitHub gives them."""
    config.mdx_configs.setdefault("toc", {})["slugify"] = anchor
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Adds the front page and whatever documents lead to, one after the other."""
    found = {in_project(file.src_uri) for file in files}
    waiting = ["README.md", *sorted(name for name in found if name.endswith(".md"))]
    while waiting:
        name = waiting.pop()
        if name not in found:
            found.add(name)
            # Beside the table of contents: documents lead there.
            level = InclusionLevel.NOT_IN_NAV
            files.append(File.generated(config, uri_of(name), abs_src_path=str(ROOT / name), inclusion=level))
        if name.endswith(".md"):
            targets = (target_of(name, link) for link in links((ROOT / name).read_text()))
            waiting.extend(target for target in targets if target not in found and (ROOT / target).is_file())
    return files


def on_page_markdown(markdown: str, page: Page, **_: Any) -> str:
    """Links between files of the project become links between pages of the site."""
    name = in_project(page.file.src_uri)

    def turned(match: re.Match[str]) -> str:
        link = match[0]
        target = target_of(name, link)
        if _EXTERNAL.match(link) or not (ROOT / target).is_file():
            return link
        return posixpath.relpath(uri_of(target), posixpath.dirname(page.file.src_uri) or ".")

    parts = _CODE.split(markdown)
    codes = _CODE.findall(markdown)
    return "".join(_LINK.sub(turned, part) + code for part, code in zip(parts, [*codes, ""]))


def links(text: str) -> list[str]:
    """Files that a document links to, as written."""
    found = _LINK.findall("".join(_CODE.split(text)))
    return [link for link in found if not _EXTERNAL.match(link)]


def target_of(name: str, link: str) -> str:
    """Path in the project of what a file of the project links to."""
    return posixpath.normpath(posixpath.join(posixpath.dirname(name), link))


def in_project(uri: str) -> str:
    """Path in the project of a source file of the site."""
    if uri == "index.md":
        return "README.md"
    return uri.removeprefix(f"{OTHERS}/") if uri.startswith(f"{OTHERS}/") else f"docs/{uri}"


def uri_of(name: str) -> str:
    """Path among the sources of the site of a file of the project."""
    if name == "README.md":
        return "index.md"
    return name.removeprefix("docs/") if name.startswith("docs/") else posixpath.join(OTHERS, name)


def anchor(heading: str, separator: str) -> str:
    """Anchor of a heading, as GitHub names it."""
    kept = (letter for letter in heading.strip().lower() if letter.isalnum() or letter in "-_ ")
    return "".join(kept).replace(" ", separator)
