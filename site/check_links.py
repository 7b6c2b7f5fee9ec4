"""Checks the links of the docs: in the sources, as a forge or an editor follows them, and in the built pages.

    python site/check_links.py target/site/html

Sources: a relative link leads to a committed file or folder, and its anchor to a heading there. Pages: every link
inside leads to a file of the site and an anchor in it; scripts, styles, pictures and frames are files of the site.
Links to elsewhere are `https://` with a host (`http://` for this machine only); they are not visited.
"""

import html.parser
import pathlib
import re
import subprocess
import sys
import urllib.parse

ROOT = pathlib.Path(__file__).resolve().parent.parent
FENCE = re.compile(r"^ *(```|~~~).*?^ *\1", re.M | re.S)
CODE = re.compile(r"`[^`\n]*`")
LINK = re.compile(r"!?\[(?:[^\[\]]|\[[^\]]*\])*\]\(\s*<?([^)\s>]+)>?(?:\s+\"[^\"]*\")?\s*\)")
HTML_LINK = re.compile(r"<(?:a|img)\b[^>]*?\b(?:href|src)=\"([^\"]+)\"")
LOCAL_HOSTS = {"127.0.0.1", "localhost"}
# What a browser fetches by itself.
FETCHED = {
    "script": "src",
    "img": "src",
    "iframe": "src",
    "source": "src",
    "video": "src",
    "audio": "src",
    "link": "href",
}
# Links of a head that a browser does not fetch.
TOLD = {"canonical", "alternate", "next", "prev"}


def slug(heading):
    """The anchor of a heading, as GitHub makes it."""
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).strip().lower()
    return re.sub(r"[^\w\- ]", "", text).replace(" ", "-")


def anchors(markdown):
    found, seen = set(), {}
    for heading in re.findall(r"^#{1,6} +(.+?) *#*$", FENCE.sub("", markdown), re.M):
        made = slug(heading)
        number = seen[made] = seen.get(made, -1) + 1
        found.add(f"{made}-{number}" if number else made)
    return found | set(re.findall(r"<a (?:id|name)=\"([^\"]+)\"", markdown))


def elsewhere(url):
    """What is wrong with a link to another host, if anything is."""
    parts = urllib.parse.urlsplit(url)
    if parts.scheme in ("mailto", "data"):
        return None
    if parts.scheme == "http" and parts.hostname in LOCAL_HOSTS:
        return None
    if parts.scheme != "https" or not re.fullmatch(r"[a-z0-9-]+(\.[a-z0-9-]+)+", parts.hostname or ""):
        return "not https:// with a host"
    return None


def sources():
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        check=True,
        capture_output=True,
        text=True,
    )
    files = {name for name in listed.stdout.split("\0") if name and (ROOT / name).exists()}
    folders = {str(parent) for name in files for parent in pathlib.PurePosixPath(name).parents}
    count, faults, known = 0, [], {}
    for name in sorted(name for name in files if name.endswith(".md")):
        text = CODE.sub("", FENCE.sub("", (ROOT / name).read_text()))
        for url in LINK.findall(text) + HTML_LINK.findall(text):
            count += 1
            if urllib.parse.urlsplit(url).scheme:
                if fault := elsewhere(url):
                    faults.append(f"{name}: {url}: {fault}")
                continue
            path, _, anchor = url.partition("#")
            inside = (ROOT / name).parent / path if path else ROOT / name
            try:
                target = str(inside.resolve().relative_to(ROOT))
            except ValueError:
                faults.append(f"{name}: {url} leads out of the repository")
                continue
            if target not in files and target not in folders:
                faults.append(f"{name}: {url}: no such file")
            elif anchor and target.endswith(".md"):
                if target not in known:
                    known[target] = anchors((ROOT / target).read_text())
                if anchor not in known[target]:
                    faults.append(f"{name}: {url}: no such heading")
    return count, faults


class Page(html.parser.HTMLParser):
    """The links of a page, what it fetches, and its anchors."""

    def __init__(self, text):
        super().__init__()
        self.links, self.fetched, self.anchors = [], [], {"", "top"}
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        given = {name: value or "" for name, value in attrs}
        self.anchors |= {given[name] for name in ("id", "name") if name in given}
        if tag == "a" and "href" in given:
            self.links.append(given["href"])
        elif tag in FETCHED and FETCHED[tag] in given:
            kept = self.links if set(given.get("rel", "").split()) & TOLD else self.fetched
            kept.append(given[FETCHED[tag]])


def pages(folder):
    read = {path: Page(path.read_text()) for path in sorted(folder.rglob("*.html"))}
    count, faults = 0, []
    for path, page in read.items():
        name = path.relative_to(folder)
        for url in page.links + page.fetched:
            count += 1
            parts = urllib.parse.urlsplit(url)
            if parts.scheme or parts.netloc:
                if url in page.fetched and parts.scheme != "data":
                    faults.append(f"{name} fetches {url}")
                elif fault := elsewhere(url):
                    faults.append(f"{name}: {url}: {fault}")
                continue
            # The page for addresses that do not exist names files from the root of a server.
            base = folder if parts.path.startswith("/") else path.parent
            target = (base / urllib.parse.unquote(parts.path).lstrip("/")).resolve() if parts.path else path
            target = target / "index.html" if target.is_dir() else target
            if not target.is_file():
                faults.append(f"{name}: {url}: no such file")
            elif target in read and urllib.parse.unquote(parts.fragment) not in read[target].anchors:
                faults.append(f"{name}: {url}: no such anchor")
    for path in folder.rglob("*.css"):
        for url in re.findall(r"(?:url\(|@import\s+)['\"]?((?:https?:)?//[^'\")]+)", path.read_text()):
            faults.append(f"{path.relative_to(folder)} fetches {url}")
    return len(read), count, faults


def main():
    folder = pathlib.Path(sys.argv[1]).resolve()
    in_sources, faults = sources()
    number, in_pages, more = pages(folder)
    for fault in faults + more:
        print(fault)
    print(f"{in_sources} links in the sources, {in_pages} in {number} pages; {len(faults + more)} are wrong")
    sys.exit(bool(faults + more) or not in_sources or not in_pages)


if __name__ == "__main__":
    main()
