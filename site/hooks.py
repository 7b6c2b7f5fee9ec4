"""What the pages of the site have beyond those of the repository."""

import html
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
    shown = {}
    for path, methods in document["paths"].items():
        for method, operation in methods.items():
            if isinstance(operation, dict) and "operationId" in operation:
                shown.setdefault(operation["tags"][0], []).append(details(document, method, path, operation))
    sections = [
        f"### {tag['name']}\n\n{tag['description']}\n\n" + "\n".join(shown.pop(tag["name"])) for tag in document["tags"]
    ]
    assert not shown, f"tags without a description: {list(shown)}"
    return "\n\n".join(sections)


def details(document, method, path, operation):
    """One operation as HTML: a line, which opens to the rest."""

    def target(one):
        group, name = one["$ref"].split("/")[-2:] if "$ref" in one else (None, None)
        return {**document["components"][group][name], **one} if group else one

    parameters = [target(one) for one in operation.get("parameters", [])]
    answers = [(status, target(one)) for status, one in operation["responses"].items()]
    body = operation.get("requestBody", {}).get("content", {})
    parts = [f"<p>{prose(operation['description'])}</p>"] if "description" in operation else []
    parts.append(
        table(
            "Parameters",
            ["Name", "In", "Type", "Meaning"],
            [
                [code(one["name"]), one["in"], type_of(one.get("schema", {})), prose(one.get("description", ""))]
                for one in parameters
            ],
        )
    )
    parts.append(
        table(
            "Body",
            ["Media type", "Type"],
            [[code(kind), type_of(content.get("schema", {}))] for kind, content in body.items()],
        )
    )
    parts.append(
        table(
            "Answers",
            ["Status", "Meaning", "Media types"],
            [
                [
                    status,
                    prose(one["description"]),
                    ", ".join(
                        f"{code(kind)} {type_of(content.get('schema', {}))}"
                        for kind, content in one.get("content", {}).items()
                    ),
                ]
                for status, one in answers
            ],
        )
    )
    parts.append(
        table(
            "Files",
            ["Name", "Media type", "What it is", "Exists"],
            [
                [
                    code(name),
                    f"{code(one['mediaType'])} {type_of(one['schema'])}",
                    prose(one["description"]),
                    prose(one["exists"]),
                ]
                for name, one in operation.get("x-files", {}).items()
            ],
        )
    )
    parts.append(f"<pre><code>{html.escape(operation['x-codeSamples'][0]['source'])}</code></pre>")
    line = f"{code(method.upper() + ' ' + path)} {prose(operation['summary'])}"
    return f"<details><summary>{line}</summary>\n{''.join(parts)}\n</details>\n"


def table(caption, head, rows):
    if not rows:
        return ""
    cells = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows)
    heads = "".join(f"<th>{one}</th>" for one in head)
    return f"<table><caption>{caption}</caption><thead><tr>{heads}</tr></thead><tbody>{cells}</tbody></table>"


def code(text):
    return f"<code>{html.escape(text)}</code>"


def prose(text):
    """Text with code between backticks."""
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", html.escape(text, quote=False)).replace("\n\n", "</p><p>")


def type_of(schema):
    """The name of a schema, or the kind of its values."""
    if "$ref" in schema:
        return schema["$ref"].split("/")[-1]
    parts = schema.get("oneOf") or schema.get("anyOf")
    if parts:
        return " or ".join(dict.fromkeys(map(type_of, parts)))
    if schema.get("format") == "binary":
        return "bytes"
    kind = schema.get("type", "")
    return " or ".join(kind) if isinstance(kind, list) else kind
