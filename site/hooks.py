"""What the pages of the site have beyond those of the repository."""
import json
import pathlib
import posixpath
import re

ROOT = pathlib.Path(__file__).resolve().parent.parent
LINK = re.compile(r"(?<=\]\()([^)#:\s]+)(?=\))")
OPERATIONS = "<!-- operations -->"
LOGS = "docs/log/"


def on_page_markdown(markdown, page, files, **_):
    """Links to folders lead to the folder's own page, as they do where the sources are shown. Logs are left out of the
    search, so that it finds the pages for users."""
    if page.file.src_uri.startswith(LOGS):
        page.meta["search"] = {"exclude": True}
    folder = posixpath.dirname(page.file.src_uri)

    def led(match):
        inside = posixpath.normpath(posixpath.join(folder, match[1], "README.md"))
        return posixpath.join(match[1], "README.md") if files.get_file_from_path(inside) else match[1]

    markdown = LINK.sub(led, markdown)
    return markdown.replace(OPERATIONS, operations()) if OPERATIONS in markdown else markdown


def on_page_content(html, page, **_):
    """Links of notebooks lead to pages: mkdocs-jupyter leaves them as they are."""
    if not page.file.src_uri.endswith(".ipynb"):
        return html
    return re.sub(r'(?<=href=")([^":]+)\.md(?=["#])', r"\1.html", html)


def operations():
    """Every operation of the service by its tag: text, which the site's search finds and every browser shows."""
    document = json.loads((ROOT / "openapi/ventriform.json").read_text())
    rows = {}
    for path, methods in document["paths"].items():
        for method, operation in methods.items():
            if isinstance(operation, dict) and "operationId" in operation:
                row = f"| {method.upper()} | `{path}` | {operation['summary'].replace('|', '&#124;')} |"
                rows.setdefault(operation["tags"][0], []).append(row)
    sections = [
        f"### {tag['name']}\n\n{tag['description']}\n\n| method | path | what it does |\n|---|---|---|\n"
        + "\n".join(rows.pop(tag["name"]))
        for tag in document["tags"]
    ]
    assert not rows, f"tags without a description: {list(rows)}"
    return "\n\n".join(sections)
