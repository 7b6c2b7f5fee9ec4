"""Checks what the site shows beyond its sources: parameters in the Python reference, outputs in the notebooks.

    python site/check_reference.py target/site

In: reference.json, and the pages in html/. Guaranteed: every parameter of every function has a row in the reference,
with its default; every notebook has a picture, and no cell ended with an error.
"""

import html
import json
import pathlib
import re
import sys

folder = pathlib.Path(sys.argv[1])
functions = json.loads((folder / "reference.json").read_text())
page = (folder / "html/site/python-reference.html").read_text()
faults, rows = [], 0
for name, told in functions.items():
    section = re.search(rf'id="ventriform\.{name}".*?(?=<h3 id="ventriform\.|\Z)', page, re.S)
    if not section:
        faults.append(f"the reference has no {name}")
        continue
    cells = [
        [html.unescape(re.sub(r"<[^>]+>", "", cell)).strip() for cell in re.findall(r"<td>(.*?)</td>", row, re.S)]
        for row in re.findall(r'<tr class="doc-section-item">.*?</tr>', section[0], re.S)
    ]
    defaults = {row[0].lstrip("*"): row[-1] for row in cells if len(row) == 4}
    for one in told["parameters"]:
        rows += 1
        wanted = one["default"] or "required"
        shown = defaults.get(one["name"])
        if shown is None:
            faults.append(f"{name}: no row for {one['name']}")
        elif shown != wanted:
            faults.append(f"{name}: the default of {one['name']} is shown as {shown}, and is {wanted}")
notebooks = list((folder / "source/python/examples").glob("*.ipynb"))
for notebook in notebooks:
    shown = (folder / "html/python/examples" / notebook.with_suffix(".html").name).read_text()
    if "data:image/png;base64" not in shown:
        faults.append(f"{notebook.name}: no picture")
    outputs = [out for cell in json.loads(notebook.read_text())["cells"] for out in cell.get("outputs", [])]
    faults += [f"{notebook.name}: {out['ename']}" for out in outputs if out["output_type"] == "error"]
for fault in faults:
    print(fault)
print(f"{rows} parameters of {len(functions)} functions, {len(notebooks)} notebooks with outputs; {len(faults)} faults")
sys.exit(bool(faults) or not rows or not notebooks)
