"""Pages of the docs site for the notebooks: a hook of mkdocs, which needs no Jupyter and checks their links."""

from __future__ import annotations

import json
import re
from typing import Any

NOTEBOOK = re.compile(r"(\]\((?!https?:)[^)\s]+)\.ipynb\)")


def as_markdown(notebook: str, name: str) -> str:
    """Text and code of a notebook, with a link to the file behind its title."""
    parts = []
    for cell in json.loads(notebook)["cells"]:
        source = "".join(cell["source"])
        parts.append(f"```python\n{source}\n```" if cell["cell_type"] == "code" else _to_pages(source))
    title, _, rest = parts[0].partition("\n")
    return "\n\n".join([title, f"[This page as a notebook]({name})", rest.strip(), *parts[1:]]) + "\n"


def _to_pages(markdown: str) -> str:
    return NOTEBOOK.sub(r"\1.md)", markdown)


def on_files(files: Any, config: Any) -> Any:
    """Add a page beside each notebook."""
    from mkdocs.structure.files import File

    for file in [f for f in files if f.src_uri.endswith(".ipynb")]:
        uri = file.src_uri.removesuffix(".ipynb") + ".md"
        name = file.src_uri.rpartition("/")[2]
        files.append(File.generated(config, uri, content=as_markdown(file.content_string, name)))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Lead from other pages to these pages; theirs lead to the files."""
    return markdown if page.file.generated_by else _to_pages(markdown)
