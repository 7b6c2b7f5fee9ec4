"""Texts that pydicom encodes in every character set of DICOM, and those of David Clunie's example files, read back.

usage: names.py PROGRAM DIR

The example files (which pydicom brings along) hold the names of PS3.5, annexes H to K, as the standard encodes them;
the names they stand for are below, as pydicom's own tests have them. Beside them, every character of every set is
encoded by pydicom, by its term alone and as a code extension, and must come back from `inspect` as it was (of Unicode
and GB18030, sixty values).
"""

import json
import re
import subprocess
import sys
import warnings
from pathlib import Path

import pydicom
from pydicom.charset import encode_string, python_encoding
from pydicom.data import get_charset_files, get_testdata_file

program, out = sys.argv[1], Path(sys.argv[2])
out.mkdir(parents=True, exist_ok=True)
warnings.simplefilter("ignore")

EXAMPLES = {
    "chrArab": "قباني^لنزار",
    "chrFren": "Buc^Jérôme",
    "chrFrenMulti": "Buc^Jérôme",
    "chrGerm": "Äneas^Rüdiger",
    "chrGreek": "Διονυσιος",
    "chrH31": "Yamada^Tarou=山田^太郎=やまだ^たろう",
    "chrH32": "ﾔﾏﾀﾞ^ﾀﾛｳ=山田^太郎=やまだ^たろう",
    "chrHbrw": "שרון^דבורה",
    "chrI2": "Hong^Gildong=洪^吉洞=홍^길동",
    "chrJapMulti": "やまだ^たろう",
    "chrJapMultiExplicitIR6": "やまだ^たろう",
    "chrKoreanMulti": "김희중",
    "chrRuss": "Люкceмбypг",
    "chrX1": "Wang^XiaoDong=王^小東",
    "chrX2": "Wang^XiaoDong=王^小东",
}
# Longest text of the VR LO, characters.
LONGEST = 64
# Where Python's codecs and the registered sets differ, and ours follows the set.
DIFFERENT = {
    # JIS X 0201: 5C is the yen sign, 7E the overline; a backslash divides values in DICOM.
    "ISO_IR 13": "\\~",
    "ISO 2022 IR 13": "\\~",
    # GB 2312 has an em dash and a middle dot; Python's codec a horizontal bar and a katakana dot.
    "ISO 2022 IR 58": "―・",
    # Moved to two bytes in the edition of 2005.
    "GB18030": "ḿ",
}


def inspected(terms, raw):
    """The Study Description that the program reads where the file holds these bytes."""
    scan = pydicom.dcmread(get_testdata_file("CT_small.dcm"))
    scan.SpecificCharacterSet = terms
    scan.PatientName = "A"
    path = out / "name.dcm"
    scan.StudyDescription = "X" * 8
    scan.save_as(path)
    data = path.read_bytes()
    raw += b" " * (len(raw) % 2)
    # Replaced in the file, so that no library judges the bytes.
    tag = b"\x08\x00\x30\x10LO\x08\x00XXXXXXXX"
    assert data.count(tag) == 1
    data = data.replace(tag, b"\x08\x00\x30\x10LO" + len(raw).to_bytes(2, "little") + raw)
    path.write_bytes(data)
    done = subprocess.run([program, "inspect", path], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)["dicom"].get("study_description")


passed = failed = 0


def check(name, terms, raw, wanted):
    global passed, failed
    found = inspected(terms, raw)
    good = found == wanted
    passed, failed = passed + good, failed + (not good)
    if not good:
        at = next((n for n, (a, b) in enumerate(zip(found or "", wanted)) if a != b), 0)
        print(f"FAILED {name}: {(found or 'nothing')[at : at + 12]!r} for {wanted[at : at + 12]!r}")


for path in sorted(get_charset_files("*.dcm")):
    stem = Path(path).stem
    if stem not in EXAMPLES:
        continue
    example = pydicom.dcmread(path, force=True)
    terms = example.SpecificCharacterSet
    terms = [terms] if isinstance(terms, str) else list(terms)
    name = example.PatientName.original_string
    found = EXAMPLES[stem]
    # Groups of a name are kept by a text of another kind, too, but sets are restored at `^` and `=` in names only: read
    # as a name.
    scan = pydicom.dcmread(get_testdata_file("CT_small.dcm"))
    scan.SpecificCharacterSet = terms
    scan.PatientName = "X" * 8
    whole = out / "name.dcm"
    scan.save_as(whole)
    data = whole.read_bytes()
    raw = name + b" " * (len(name) % 2)
    tag = b"\x10\x00\x10\x00PN\x08\x00XXXXXXXX"
    assert data.count(tag) == 1
    whole.write_bytes(data.replace(tag, b"\x10\x00\x10\x00PN" + len(raw).to_bytes(2, "little") + raw))
    done = subprocess.run([program, "inspect", whole], capture_output=True, text=True)
    read = json.loads(done.stdout)["dicom"].get("patient_name")
    good = read == found
    passed, failed = passed + good, failed + (not good)
    if not good:
        print(f"FAILED {stem}: {read!r} for {found!r}")


def characters(codec):
    """Every printable character of a Python codec, those of ASCII left out."""
    for number in list(range(0xA0, 0x3000)) + list(range(0x3000, 0xFFFF)) + [0x1F600, 0x20000]:
        if 0xD800 <= number < 0xE000:
            continue
        letter = chr(number)
        if not letter.isprintable() or letter.isspace():
            continue
        try:
            if letter.encode(codec).decode(codec) == letter:
                yield letter
        except UnicodeError:
            pass


for term, codec in sorted(python_encoding.items()):
    # Not the plain set, and not the misspelt terms that pydicom knows as well.
    if term in ("", "ISO_IR 6", "ISO 2022 IR 6") or not re.fullmatch(r"ISO_IR \d+|ISO 2022 IR \d+|GB18030|GBK", term):
        continue
    letters = [letter for letter in characters(codec) if letter not in DIFFERENT.get(term, "")]
    multi = term in ("ISO 2022 IR 87", "ISO 2022 IR 159", "ISO 2022 IR 149", "ISO 2022 IR 58")
    if term == "ISO 2022 IR 159":
        # Its Python codec writes the other sets of Japan as well: only what lies in JIS X 0212 is this set's.
        letters = [x for x in letters if x.encode(codec).startswith(b"\x1b$(D")]
    if term == "ISO 2022 IR 87":
        letters = [x for x in letters if x.encode(codec).startswith(b"\x1b$B")]
    if term == "ISO 2022 IR 149":
        # Beyond KS X 1001 the codec composes syllables of eight bytes, which DICOM does not know.
        letters = [x for x in letters if len(x.encode(codec)) == 2]
    if term in ("ISO_IR 13", "ISO 2022 IR 13"):
        letters = [x for x in letters if len(x.encode(codec)) == 1]
    terms = ["", term] if multi else [term]
    # As many as the standard allows in one value. Of the sets that hold all of Unicode, sixty values spread over them.
    starts = range(0, len(letters), LONGEST)
    for start in starts[:: 1 if len(letters) < 10000 else -(-len(starts) // 60)]:
        text = "".join(letters[start : start + LONGEST])
        raw = encode_string(text, ["iso8859", codec] if multi else [codec])
        if term == "ISO 2022 IR 159":
            # pydicom writes letters of Latin 1 as such, where the file names no such set.
            raw = text.encode(codec)
        if term == "ISO 2022 IR 58":
            # pydicom writes this set without its escape sequence.
            raw = b"\x1b$)A" + text.encode("gb2312")
        check(f"{term}, from {start}", terms, raw, text)
    # As a code extension of Latin 1.
    if term.startswith("ISO 2022") and not multi and term != "ISO 2022 IR 100":
        text = "é" + letters[0] + "A" + letters[-1]
        try:
            raw = encode_string(text, ["latin_1", codec])
        except UnicodeError:
            continue
        check(f"{term} beside Latin 1", ["ISO 2022 IR 100", term], raw, text)
print(f"names: {passed} passed, {failed} failed")
sys.exit(failed > 0)
