"""What `segment`, `beat` and `compare` are told of DICOM objects: the flags of the commands, by the same names."""

from __future__ import annotations

import json
import os
from typing import Any

from . import _checks
from ._errors import InputError

Row = dict[str, Any]


def _text(name: str, summary: str, example: str) -> Row:
    return {"name": name, "kind": "string", "default": "", "summary": summary, "example": example}


STATED: list[Row] = [
    _text(
        "patient_id", "Patient ID; needed for a volume that is not DICOM. With `deidentify`, the new Patient ID", "4711"
    ),
    _text("patient_name", "Patient's name, as FAMILY^GIVEN. With `deidentify`, the new name", "Doe^Jane"),
    _text("patient_birth_date", "Patient's birth date, as YYYYMMDD", "19500131"),
    _text("patient_sex", "Patient's sex: M, F or O", "F"),
    _text("study_uid", "Study Instance UID; needed for a volume that is not DICOM", "1.2.840.1"),
    _text("study_date", "Date of the study, as YYYYMMDD", "20261129"),
    _text("study_id", "Study ID: the number of the study in the department", "17"),
    _text("accession_number", "Accession number", "A123"),
    _text("referring_physician", "Referring physician's name, as FAMILY^GIVEN", "Roe^Richard"),
    _text("frame_of_reference_uid", "Frame of Reference UID of the scan", "1.2.840.2"),
]

ROWS: list[Row] = [
    {
        "name": "dicom",
        "kind": "switch",
        "default": "false",
        "summary": "Also make DICOM objects of the results, of the scan's patient and study: they are among `files`",
    },
    *STATED,
    _text(
        "deidentify_secret",
        "Secret from which `deidentify` derives new UIDs: with the same secret, objects of one study stay together. "
        "Default: "
        "VENTRIFORM_DEIDENTIFY_SECRET of the environment, or a random one",
        "a long sentence",
    ),
    {
        "name": "made_at",
        "kind": "time",
        "default": "",
        "example": "2026-11-23T13:45:00Z",
        "summary": "Date and time of the DICOM objects: with the same time, the same input gives the same bytes. "
        "Default: now",
    },
]
"""Like the rows of the library's tables."""

NAMES = frozenset(row["name"] for row in ROWS)


def order(given: dict[str, Any], deidentify: bool) -> dict[str, Any] | None:
    """What the compiled part is told; None if no objects are to be made."""
    wanted = given.get("dicom", False)
    if not isinstance(wanted, bool):
        raise InputError("dicom", f"It is {wanted!r}.", "Give True or False.")
    given = {name: value for name, value in given.items() if name != "dicom" and value is not None}
    if "deidentify_secret" in given and not deidentify:
        raise InputError("deidentify_secret", "The identity is not removed.", "Set `deidentify` too, or leave it out.")
    if not wanted:
        alone = next((name for name in given if name != "deidentify_secret"), None)
        if alone is not None:
            raise InputError(alone, "No DICOM objects are asked for.", "Set `dicom` too, or leave it out.")
        return None
    stated = {row["name"]: _checks.text(row["name"], given[row["name"]]) for row in STATED if row["name"] in given}
    return {
        "stated": json.dumps(stated),
        "secret": _secret(given.get("deidentify_secret")) if deidentify else None,
        "made": _moment(given.get("made_at")),
    }


def _secret(given: Any) -> bytes:
    known = (
        os.environ.get("VENTRIFORM_DEIDENTIFY_SECRET") if given is None else _checks.text("deidentify_secret", given)
    )
    return os.urandom(16) if known is None else known.encode()


def _moment(given: Any) -> tuple[str, str]:
    """Date and time, UTC, as DICOM writes them."""
    from datetime import datetime, timezone

    fix = "Give a time with its zone, such as 2026-11-23T13:45:00Z."
    if isinstance(given, str):
        try:
            # Python 3.10 does not know the Z.
            given = datetime.fromisoformat(f"{given[:-1]}+00:00" if given[-1:] in ("Z", "z") else given)
        except ValueError as error:
            raise InputError("made_at", f"`{given}` is no time.", fix) from error
    made = datetime.now(timezone.utc) if given is None else given
    if not isinstance(made, datetime) or made.tzinfo is None:
        raise InputError("made_at", f"{made!r} is no time with a zone.", fix)
    made = made.astimezone(timezone.utc)
    return f"{made:%Y%m%d}", f"{made:%H%M%S}"
