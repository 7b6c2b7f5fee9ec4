"""What notebooks show of results: a table of figures, and a picture."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

Row = tuple[str, Any]


def table(title: str, rows: Iterable[Row], picture: bytes | None = None) -> str:
    """An HTML table of names and values, both escaped, with a PNG picture beside it."""
    lines = [
        f"<tr><th style='text-align:left'>{_text(name)}</th><td style='text-align:left'>{_text(value)}</td></tr>"
        for name, value in rows
    ]
    made = f"<table><caption style='text-align:left'><b>{_text(title)}</b></caption>{''.join(lines)}</table>"
    if picture is None:
        return made
    import base64

    data = base64.b64encode(picture).decode()
    image = f"<img alt='' style='max-height:18em' src='data:image/png;base64,{data}'>"
    return f"<div style='display:flex;gap:2em;align-items:center'>{made}{image}</div>"


def _text(value: Any) -> str:
    import html

    return html.escape(str(value))
