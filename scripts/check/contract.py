"""Compares the published document with what a running service answers.

    export SERVICE_FLAGS='--webhook-allow 127.0.0.1 --wait-limit 10m'
    scripts/with_service.sh python scripts/check/contract.py            checks
    scripts/with_service.sh python scripts/check/contract.py --record FILE     writes the examples (scripts/generate.sh)

1. The document is valid OpenAPI 3.1, and every operationId is unique.
2. Every example in it satisfies its schema, and every operation has an example of its request and answer.
3. A walk through the whole API: every JSON answer satisfies its schema, and has no field that the schema
   does not name. Every file of a result has the media type and the schema that `x-files` states.

The examples are recorded in the walk: one of every document, by its schema. A committed example stays if it still has
all fields that the recorded one has: it would only have other values.

Needs openapi-spec-validator, jsonschema, fhir.resources and pydicom, and `ventriform phantom` for a scan.
"""

import copy
import csv
import gzip
import io
import json
import math
import os
import re
import subprocess
import sys
import time
import urllib.error
import urllib.parse
import urllib.request

import pydicom
from fhir.resources.R4B.bundle import Bundle
from jsonschema import Draft202012Validator
from openapi_spec_validator import validate
from pydicom.uid import ExplicitVRLittleEndian, NuclearMedicineImageStorage, generate_uid
from referencing import Registry, Resource
from referencing.jsonschema import DRAFT202012

sys.path.insert(0, os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
from lib.nifti import nifti
from lib.service import reader_profile

URL = os.environ["SERVICE_URL"]
ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
EXAMPLES = os.path.join(ROOT, "crates", "http", "src", "openapi", "examples.json")
PROGRAM = os.path.join(ROOT, "target", "debug", "ventriform")
PROBLEM = "application/problem+json"
# Asks to wait for a job that succeeds, on however busy a machine; `--wait-limit` allows it.
UNTIL_DONE = "wait=600"
ANSWER_SECONDS = 660

# Problems that the walk cannot provoke, in the service's words.
RARE = {
    "401": (
        "unauthenticated",
        "This service needs an API key or a bearer token.",
        "Send `Authorization: Bearer KEY`; `ventriform keys create` makes a key.",
    ),
    "403": (
        "forbidden",
        "This key does not have the scope that the request needs.",
        "Ask the operator for a key with that scope.",
    ),
    "408": ("body-too-slow", "The body did not arrive in time.", "Send the request again over a faster connection."),
    "429": (
        "queue-full",
        "1000 jobs are waiting, the most that this service allows.",
        "Send the request again after `Retry-After` seconds.",
    ),
    "500": (
        "internal",
        "The service failed to answer because of an internal error, which has been logged.",
        "Report it with the x-request-id of this answer.",
    ),
    "503": ("not-ready", "The service is shutting down.", None),
    "507": ("storage-full", "The disk of the service is full.", "Ask the operator to free or add space."),
}

# The checks in the answer of a service that is not ready, which the walk does not provoke either.
NOT_READY = [
    {"name": "database", "status": "failing", "required": True, "detail": "The database does not answer."},
    {"name": "audit", "status": "failing", "required": True, "detail": "The database does not answer."},
    {"name": "files", "status": "ok", "required": True},
    {"name": "disk", "status": "ok", "required": True},
    {"name": "workers", "status": "failing", "required": True, "detail": "The database does not answer."},
    {"name": "clock", "status": "ok", "required": False},
]

# What stands in the examples for the keys and secrets of the recorded service.
SECRETS = {"key": "vf_0123456789abcdef_KEEP-IT-SECRET", "secret": "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw"}


class Contract:
    """The document, and validators of its schemas: as they are, and closed against unknown fields."""

    def __init__(self, document):
        self.document = resolved(document)
        absolute = json.loads(json.dumps(document).replace('"#/components/', '"urn:document#/components/'))
        self.registries = []
        for exact in (False, True):
            known = close(copy.deepcopy(absolute), absolute) if exact else absolute
            resource = Resource(contents=known, specification=DRAFT202012)
            self.registries.append(Registry().with_resource("urn:document", resource).crawl())

    def errors(self, schema, value, exact):
        schema = json.loads(json.dumps(schema).replace('"#/components/', '"urn:document#/components/'))
        validator = Draft202012Validator(
            close(schema, self.document) if exact else schema, registry=self.registries[exact]
        )
        return [f"{'/'.join(map(str, e.absolute_path))}: {e.message[:200]}" for e in validator.iter_errors(value)]

    def operations(self):
        for path, item in self.document["paths"].items():
            for method, operation in item.items():
                if isinstance(operation, dict) and "operationId" in operation:
                    yield path, method, operation


def resolved(document):
    """The document with parameters, answers and headers in place of references to them."""
    document = copy.deepcopy(document)

    def target(value):
        if "$ref" not in value:
            return value
        group, name = value["$ref"].split("/")[-2:]
        return {**document["components"][group][name], **{key: own for key, own in value.items() if key != "$ref"}}

    for item in document["paths"].values():
        for operation in item.values():
            operation["parameters"] = [target(one) for one in operation.get("parameters", [])]
            operation["responses"] = {status: target(one) for status, one in operation["responses"].items()}
            for answer in operation["responses"].values():
                answer["headers"] = {name: target(one) for name, one in answer.get("headers", {}).items()}
    return document


def close(schema, document):
    """The schema with every object closed against fields that it does not name."""
    if isinstance(schema, dict):
        merge(schema, document)
        if "properties" in schema and "additionalProperties" not in schema:
            schema["additionalProperties"] = False
        for value in schema.values():
            close(value, document)
    elif isinstance(schema, list):
        for value in schema:
            close(value, document)
    return schema


def merge(schema, document):
    """One object in place of `allOf` of several, each of which would refuse the fields of the others."""
    for part in schema.pop("allOf", []):
        if "$ref" in part:
            part = document["components"]["schemas"][part["$ref"].split("/")[-1]]
        part = copy.deepcopy(part)
        schema.setdefault("properties", {}).update(part.pop("properties", {}))
        schema.setdefault("required", []).extend(part.pop("required", []))
        schema.update({name: value for name, value in part.items() if name not in schema})


def short(value):
    """The value with long lists cut: of objects one is enough, and of more than a box's six numbers two."""
    if isinstance(value, dict):
        return {key: short(part) for key, part in value.items()}
    if isinstance(value, list):
        objects = all(isinstance(part, dict) for part in value)
        most = 1 if objects else len(value) if len(value) <= 6 else 2
        return [short(part) for part in value[:most]]
    return value


def form(files):
    """A multipart body and its media type."""
    mark = "----contract"
    parts = b""
    for name, data in files.items():
        parts += (
            (
                f'--{mark}\r\nContent-Disposition: form-data; name="{name}"; filename="{name}.nii.gz"\r\n'
                "Content-Type: application/gzip\r\n\r\n"
            ).encode()
            + data
            + b"\r\n"
        )
    return parts + f"--{mark}--\r\n".encode(), f"multipart/form-data; boundary={mark}"


class Walk:
    """Requests to the service, each checked against the document and recorded as an example."""

    def __init__(self, contract):
        self.contract, self.failures, self.seen = contract, [], set()
        self.recorded = {"problems": {}, "parameters": {}, "documents": {}, "operations": {}}
        self.credentials = {}

    def call(self, method, template, *, expect, query="", body=None, headers=None, cut=True, **parameters):
        operation = self.contract.document["paths"][template][method]
        name = operation["operationId"]
        path = template
        for key, value in parameters.items():
            path = path.replace("{" + key + "}", value)
            part = template.index("{" + key + "}") + len(key) + 2
            # The names of files are in the document.
            if key != "file":
                self.recorded["parameters"][template[:part]] = value
        headers = {**self.credentials, **(headers or {})}
        data = body
        if isinstance(body, (dict, list)):
            headers["content-type"] = "application/json"
            data = json.dumps(body).encode()
            if expect < 300:
                for kind, content in operation["requestBody"]["content"].items():
                    if kind.endswith("json"):
                        self.record(name, "request", kind, content["schema"], short(body))
        request = urllib.request.Request(URL + path + query, data=data, method=method.upper(), headers=headers)
        try:
            answer = urllib.request.urlopen(request, timeout=ANSWER_SECONDS)
        except urllib.error.HTTPError as error:
            answer = error
        content, media_type = answer.read(), (answer.headers.get("content-type") or "").split(";")[0]
        status = str(answer.status)
        self.seen.add(name)
        file = operation.get("x-files", {}).get(parameters.get("file", ""))
        what = f"{method.upper()} {template} {status} {parameters.get('file', '')}"
        if answer.status != expect:
            self.failures.append(f"{what}: expected {expect}: {content[:300]!r}")
            return answer, content
        documented = operation["responses"].get(status)
        if documented is None:
            self.failures.append(f"{what}: the status is not documented")
            return answer, content
        media = documented.get("content", {})
        if file and answer.status == 200 and media_type != file["mediaType"]:
            self.failures.append(f"{what}: {media_type} is not documented")
        elif content and media_type not in media:
            self.failures.append(f"{what}: {media_type} is not documented")
        elif media_type.endswith("json"):
            value = json.loads(content)
            schema = file["schema"] if file and answer.status == 200 else media[media_type]["schema"]
            for error in self.contract.errors(schema, value, exact=True):
                self.failures.append(f"{what}: {error}")
            if media_type == PROBLEM:
                self.recorded["problems"].setdefault(status, value)
            elif media_type in ("application/json", "application/dicom+json", "application/fhir+json"):
                self.record(name, status, media_type, schema, short(value) if cut else value)
            return answer, value
        elif media_type == "text/plain":
            self.record(name, status, media_type, {}, "\n".join(content.decode().split("\n")[:6]) + "\n")
        return answer, content

    def record(self, operation, status, media_type, schema, value):
        """Keeps the first example of a schema's documents, and of an operation's whose schema has no name."""
        schemas = [schema, *schema.get("oneOf", []), *schema.get("anyOf", [])]
        named = [one for one in schemas if "$ref" in one]
        for one in named:
            if not self.contract.errors(one, value, exact=True):
                self.recorded["documents"].setdefault(one["$ref"].split("/")[-1], value)
                return
        if not named:
            self.recorded["operations"].setdefault(operation, {}).setdefault(status, {})[media_type] = value


def wait(walk, job):
    while job["state"] in ("queued", "running"):
        time.sleep(0.05)
        _, job = walk.call("get", "/v1/jobs/{id}", expect=200, id=job["id"])
    assert job["state"] == "succeeded", job
    # A finished job has most to say.
    walk.recorded["documents"]["Job"] = short(job)
    return job


def event(walk, job):
    """The last event of a finished job, as an example."""
    text = urllib.request.urlopen(f"{URL}/v1/jobs/{job['id']}/events", timeout=30).read().decode()
    fields = dict(line.split(": ", 1) if ": " in line else line.split(":", 1) for line in text.strip().split("\n"))
    walk.recorded["operations"]["follow_job"] = {"200": {"text/event-stream": fields}}
    walk.seen.add("follow_job")


def limits(walk, folder):
    """Normal limits of simulated people, built of stored volumes, added again as a file."""
    call, cases = walk.call, []
    healthy = os.path.join(folder, "healthy")
    subprocess.run([PROGRAM, "phantom", "--normal", "--cases", "14", "-o", healthy], check=True, capture_output=True)
    for row in csv.DictReader(open(os.path.join(healthy, "cohort.csv"))):
        request = urllib.request.Request(
            f"{URL}/v1/volumes",
            data=open(os.path.join(healthy, row["file"]), "rb").read(),
            headers={"content-type": "application/octet-stream"},
            method="POST",
        )
        stored = json.load(urllib.request.urlopen(request))
        told = {name: row[name] for name in ("case", "sex", "protocol", "tracer")}
        cases.append(
            {
                **told,
                "volume": stored["id"],
                "attenuation_corrected": row["attenuation_corrected"] == "yes",
                "healthy": row["healthy"] == "yes",
            }
        )
    order = {"name": "simulated", "cases": cases, "parameters": {"mixed": True}}
    _, job = call("post", "/v1/normals", expect=202, body=order)
    normals = wait(walk, job)["normals"]
    file = json.loads(urllib.request.urlopen(f"{URL}/v1/normals/{normals}/normals.json").read())
    # As a file of its own the limits have another id.
    _, added = call("post", "/v1/normals", expect=201, query="?name=copy", body=file)
    call("post", "/v1/normals", expect=200, query="?name=copy", body=file)
    call("delete", "/v1/normals/{id}", expect=204, id=added["id"])
    call("get", "/v1/normals", expect=200)
    return normals


def rest_and_stress(walk, folder, rest, normals):
    """A comparison of a scan with one that has a defect."""
    stress = os.path.join(folder, "stress")
    defect = ["--defect", "7:0.6", "--defect", "8:0.6", "--defect", "13:0.6", "--defect", "14:0.6"]
    subprocess.run(
        [PROGRAM, "phantom", "-o", stress, "--size", "64", "--spacing", "6.4", "--seed", "2", *defect],
        check=True,
        capture_output=True,
    )
    call = walk.call
    octets = {"content-type": "application/octet-stream"}
    scan = open(os.path.join(stress, "spect.nii.gz"), "rb").read()
    request = urllib.request.Request(f"{URL}/v1/volumes", data=scan, headers=octets, method="POST")
    stored = json.load(urllib.request.urlopen(request))
    stated = {
        "patient_id": "4711",
        "patient_name": "Doe^Jane",
        "study_uid": "1.2.840.99999.1.2",
        "accession_number": "A18",
    }
    call("put", "/v1/volumes/{id}/identity", expect=200, id=stored["id"], body=stated)
    # The only protocol of the limits has neither word in its name.
    protocol = json.load(urllib.request.urlopen(f"{URL}/v1/normals/{normals}"))["summary"]["groups"][0]["protocol"]
    parameters = {"sex": "F", "stress_protocol": protocol, "rest_protocol": protocol}
    order = {"stress": stored["id"], "rest": rest, "normals": normals, "parameters": parameters}
    _, job = call("post", "/v1/comparisons", expect=202, body=order)
    comparison = wait(walk, job)["comparison"]
    waiting = {"prefer": UNTIL_DONE, "accept": "application/json"}
    call("post", "/v1/comparisons", expect=200, body=order, headers=waiting)
    call("get", "/v1/comparisons", expect=200)
    return comparison


def serials(walk, folder, first):
    """Scans of one patient over the years: the first one, and the one that `rest_and_stress` stored."""
    call = walk.call
    scan = open(os.path.join(folder, "stress", "spect.nii.gz"), "rb").read()
    octets = {"content-type": "application/octet-stream"}
    request = urllib.request.Request(f"{URL}/v1/volumes", data=scan, headers=octets, method="POST")
    stored = json.load(urllib.request.urlopen(request))
    # The structured report belongs to a patient and a study.
    identity = {"patient_id": "4711", "study_uid": "1.2.840.99999.2"}
    call("put", "/v1/volumes/{id}/identity", expect=200, id=stored["id"], body=identity)
    order = {"scans": [first, stored["id"]], "parameters": {"same_patient": True}}
    _, job = call("post", "/v1/serials", expect=202, body=order)
    serial = wait(walk, job)["serial"]
    waiting = {"prefer": UNTIL_DONE, "accept": "application/json"}
    call("post", "/v1/serials", expect=200, body=order, headers=waiting)
    call("get", "/v1/serials", expect=200)
    return serial


def readings(walk, results):
    """A reading of each kind of result that is read, and the reading of the comparison amended; by kind of result."""
    call = walk.call
    scores = [0] * 16 + [2]
    stated = {"reader": "Doe^Jane^^Dr.", "quality": "fair", "limits": "Simulated.", "impression": "No doubt.\nNormal."}
    read = {}
    for kind, own in {
        "comparisons": {"stress_scores": scores, "rest_scores": [0] * 17},
        "segmentations": {"scores": scores},
        "beats": {},
    }.items():
        order = {**stated, **own, "result": results[kind]}
        _, job = call("post", "/v1/readings", expect=202, body=order)
        read[kind] = wait(walk, job)["reading"]
    call("post", "/v1/readings", expect=409, body={**stated, "result": results["beats"]})
    again = {**stated, "result": results["beats"], "amends": read["beats"]}
    waiting = {"prefer": UNTIL_DONE, "accept": "application/json"}
    call("post", "/v1/readings", expect=200, body=again, headers=waiting)
    _, listed = call("get", "/v1/readings", expect=200)
    statuses = {}
    for reading in listed["readings"]:
        bundle = json.load(urllib.request.urlopen(f"{URL}{reading['links']['fhir']}"))
        assert Bundle.model_validate(bundle).entry[0].resource.conclusion == stated["impression"]
        statuses[reading["id"]] = bundle["entry"][0]["resource"]["status"]
    amended = listed["readings"][0]["id"]
    assert statuses == {amended: "amended", **{own: "final" for own in read.values()}}, statuses
    return read


# The files that a reading of a beat does not have.
READ_OF = {
    "report.json": "segmentations",
    "mask.nii.gz": "segmentations",
    "mesh.json": "segmentations",
    "comparison.json": "comparisons",
    "slices.png": "comparisons",
    "polar_stress.svg": "comparisons",
    "polar_rest.svg": "comparisons",
    "polar_difference.svg": "comparisons",
}


def workitems(walk):
    """A work item's life: scheduled, claimed, changed, canceled, erased."""
    uid, transaction = "1.2.840.99999.3", {"vr": "UI", "Value": ["1.2.840.99999.4"]}

    def call(method, path, body, expect, query=""):
        named = {"uid": uid} if path else {}
        walk.call(method, f"/dicom-web/workitems{path}", expect=expect, query=query, body=[body], **named)

    def state(name):
        return {"00741000": {"vr": "CS", "Value": [name]}}

    call("post", "", state("SCHEDULED"), 201, f"?workitem={uid}")
    call("put", "/{uid}/state", {**state("IN PROGRESS"), "00081195": transaction}, 200)
    call("post", "/{uid}", {"00741204": {"vr": "LO", "Value": ["Fit"]}, "00081195": transaction}, 200)
    call("post", "/{uid}/cancelrequest", {"00741238": {"vr": "LT", "Value": ["not needed"]}}, 202)
    walk.call("get", "/dicom-web/workitems/{uid}", expect=200, uid=uid)
    walk.call("get", "/dicom-web/workitems", expect=200)
    walk.call("delete", "/dicom-web/workitems/{uid}", expect=200, headers={"prefer": "return=representation"}, uid=uid)


def beating():
    """A heart in eight gates, as NIfTI: half an ellipsoid about an axis, which shrinks and thickens."""
    side, axis, base_mm, blur_mm = 40, (-0.64, 0.6, -0.48), 14.0, 2.4

    def within(distance):
        return 1 / (1 + math.exp(min(distance / blur_mm, 50)))

    # Distance along and across the axis of every voxel, mm; i runs fastest.
    places = []
    for k in range(side):
        for j in range(side):
            for i in range(side):
                point = [4 * (n - side / 2) for n in (i, j, k)]
                along = sum(x * a for x, a in zip(point, axis))
                places.append((along, math.sqrt(max(sum(x * x for x in point) - along * along, 0))))
    voxels = []
    for contraction in (0, 0.4, 0.85, 1, 0.75, 0.45, 0.2, 0.05):
        across, down, thickness = 24 - 7.5 * contraction, 50 - 4 * contraction, 9 + 4.5 * contraction
        for along, off in places:

            def inside(a, b):
                share = math.hypot(off / a, along / b)
                return within((share - 1) * math.hypot(off, along) / max(share, 0.01))

            inner, outer = inside(across, down), inside(across + thickness, down + thickness)
            apical = within(-base_mm - along)
            voxels.append(round(1000 * apical * max(outer - inner, 0) + 120 * apical * inner + 100 * (1 - outer)))
    return nifti(side, voxels, volumes=8)


def everything(walk, folder):
    """Every operation once, and every problem that is easy to provoke."""
    scan = open(os.path.join(folder, "spect.nii.gz"), "rb").read()
    truth = open(os.path.join(folder, "lv_truth.nii.gz"), "rb").read()
    octets = {"content-type": "application/octet-stream"}
    call = walk.call
    for template in ("/healthz", "/readyz", "/metrics"):
        call("get", template, expect=200)

    # A patient of whom nothing is left.
    _, volume = call("post", "/v1/volumes", expect=201, body=gzip.decompress(scan), headers=octets)
    stated = {"patient_id": "4712", "study_uid": "1.2.840.99999.1.2"}
    call("put", "/v1/volumes/{id}/identity", expect=200, id=volume["id"], body=stated)
    for query, status in (("", 422), ("?patient=", 422), ("?patient=4713", 404), ("?patient=4712&dry_run=true", 200)):
        call("delete", "/v1/volumes", expect=status, query=query)
    call("delete", "/v1/volumes", expect=409, query="?patient=4712&plan=" + "0" * 32)
    call("delete", "/v1/volumes", expect=200, query="?patient=4712", headers={"prefer": "return=representation"})
    _, volume = call("post", "/v1/volumes", expect=201, body=scan, headers=octets)
    call("post", "/v1/volumes", expect=200, body=scan, headers=octets)
    call("get", "/v1/volumes", expect=200)
    call("get", "/v1/volumes/{id}", expect=200, id=volume["id"])
    call("get", "/v1/volumes/{id}/preview.png", expect=200, id=volume["id"])
    call("get", "/v1/volumes/{id}/voxels.nii.gz", expect=200, id=volume["id"])
    call("get", "/v1/volumes/{id}/content", expect=200, id=volume["id"])
    call("get", "/v1/volumes/{id}/files/{name}", expect=200, id=volume["id"], name=volume["originals"][0]["name"])
    names = {"external_id": "A-2026-17", "labels": {"study": "42"}}
    call("patch", "/v1/volumes/{id}", expect=200, id=volume["id"], body=names)
    stated = {
        "patient_id": "4711",
        "patient_name": "Doe^Jane",
        "study_uid": "1.2.840.99999.1.1",
        "accession_number": "A17",
    }
    call("put", "/v1/volumes/{id}/identity", expect=200, id=volume["id"], body=stated)
    call("get", "/v1/volumes/{id}/identity", expect=200, id=volume["id"])
    call("put", "/v1/volumes/{id}/hold", expect=200, id=volume["id"], body={"reason": "Case 17/2026"})
    call("delete", "/v1/volumes/{id}/hold", expect=204, id=volume["id"])

    order = {"kind": "model", "volume": volume["id"], "parameters": {"points": 24, "iso": "50%"}}
    _, job = call("post", "/v1/jobs", expect=202, body=order)
    job = wait(walk, job)
    event(walk, job)
    call("patch", "/v1/jobs/{id}", expect=200, id=job["id"], body=names)
    call("get", "/v1/jobs", expect=200)
    _, job = call("post", "/v1/models", expect=202, query="?points=110", body=scan, headers=octets)
    template_model = wait(walk, job)["model"]
    call(
        "post",
        "/v1/models",
        expect=200,
        query="?points=12",
        body=scan,
        cut=False,
        headers={**octets, "prefer": UNTIL_DONE, "accept": "application/json"},
    )
    _, models = call("get", "/v1/models", expect=200)
    model = models["models"][0]["id"]
    body, kind = form({"volume": scan, "expert": truth})
    _, job = call("post", "/v1/segmentations", expect=202, body=body, headers={"content-type": kind})
    segmentation = wait(walk, job)["segmentation"]
    call(
        "post",
        "/v1/segmentations",
        expect=200,
        body=body,
        headers={"content-type": kind, "prefer": UNTIL_DONE, "accept": "application/json"},
    )
    _, job = call(
        "post", "/v1/segmentations", expect=202, query="?edge=anatomical", body=body, headers={"content-type": kind}
    )
    anatomical = wait(walk, job)["segmentation"]
    raw = open(os.path.join(folder, "raw.dcm"), "rb").read()
    query = "?correct_motion=true&filter=gaussian"
    _, job = call("post", "/v1/segmentations", expect=202, query=query, body=raw, headers=octets)
    from_views = wait(walk, job)["segmentation"]
    call("get", "/v1/segmentations", expect=200)
    call("get", "/v1/segmentations/{id}", expect=200, id=segmentation)
    gated = beating()
    _, job = call("post", "/v1/beats", expect=202, query="?mass_g=130", body=gated, headers=octets)
    beat = wait(walk, job)["beat"]
    # The beat's DICOM objects belong to a patient and a study.
    call("put", "/v1/volumes/{id}/identity", expect=200, id=job["volume"], body=stated)
    call(
        "post",
        "/v1/beats",
        expect=200,
        query="?mass_g=130",
        body=gated,
        headers={**octets, "prefer": UNTIL_DONE, "accept": "application/json"},
    )
    normals = limits(walk, folder)
    scored = f"?normals={normals}&sex=F"
    body, kind = form({"volume": scan, "expert": truth})
    _, job = call("post", "/v1/segmentations", expect=202, query=scored, body=body, headers={"content-type": kind})
    segmentation = wait(walk, job)["segmentation"]
    _, job = call("post", "/v1/beats", expect=202, query=scored + "&mass_g=130", body=gated, headers=octets)
    beat = wait(walk, job)["beat"]
    call("get", "/v1/beats", expect=200)
    comparison = rest_and_stress(walk, folder, volume["id"], normals)
    serial = serials(walk, folder, volume["id"])
    read = readings(walk, {"segmentations": segmentation, "beats": beat, "comparisons": comparison})
    mesh = urllib.request.urlopen(f"{URL}/v1/models/{template_model}/mesh.json").read()
    _, added = call("post", "/v1/templates", expect=201, query="?name=healthy", body=json.loads(mesh))
    call("post", "/v1/templates", expect=200, query="?name=healthy&model=" + template_model)
    call("patch", "/v1/templates/{id}", expect=200, id=added["id"], body={"library": True})
    call("get", "/v1/templates", expect=200)
    profile = reader_profile()
    _, reader = call("post", "/v1/readers", expect=201, query="?name=first", body=profile)
    call("post", "/v1/readers", expect=200, query="?name=first", body=profile)
    call("get", "/v1/readers", expect=200)

    of_kind = {
        "models": model,
        "segmentations": segmentation,
        "beats": beat,
        "comparisons": comparison,
        "serials": serial,
        # Examples show short lists, and 17 scores are one list.
        "readings": read["beats"],
        "normals": normals,
        "templates": added["id"],
        "readers": reader["id"],
        "volumes": volume["id"],
    }
    for template, item in walk.contract.document["paths"].items():
        found = re.match(
            r"/v1/(models|segmentations|beats|comparisons|serials|readings|normals|templates|readers|volumes)/\{id\}(/.*)?$",
            template,
        )
        if found and "get" in item and item["get"]["operationId"] not in walk.seen:
            accept = {"accept": "application/json"} if found[2] in ("/mesh", "/report") else {}
            made = of_kind[found[1]]
            if found[2] != "/{file}":
                call("get", template, expect=200, headers=accept, id=made)
            for name in item["get"].get("x-files", {}):
                # The files of the other wall than the one that `edge` asks for are named by it.
                if "_apparent" in name:
                    own = anatomical
                elif name == "projections.png":
                    own = from_views
                elif found[1] == "readings":
                    own = read[READ_OF.get(name, "beats")]
                else:
                    own = made
                call("get", template, expect=200, id=own, file=name.replace("NN_NN", "01_02").replace("NN", "01"))

    webhooks(walk, order)
    received(walk)
    workitems(walk)

    # Problems.
    call("get", "/v1/models/{id}", expect=400, query="?verbose=1", id=model)
    call("get", "/v1/models", expect=421, headers={"host": "elsewhere.example"})
    call("get", "/v1/models/{id}/mesh", expect=406, headers={"accept": "image/gif"}, id=model)
    call("get", "/v1/models/{id}/{file}", expect=416, headers={"range": "bytes=999999999-"}, id=model, file="mesh.glb")
    call("post", "/v1/jobs", expect=422, body={"kind": "model", "volume": volume["id"], "parameters": {"points": 3}})
    call("post", "/v1/jobs", expect=413, body={"volume": "x" * 300_000})
    call("post", "/v1/volumes", expect=415, body=b"x", headers={"content-type": "image/gif"})
    call("post", "/v1/volumes", expect=422, body=b"no volume", headers=octets)
    # More jobs than workers: the first one runs, the last one waits.
    heavy = [{**order, "parameters": {"points": 3000, "seed": seed}} for seed in range(8)]
    jobs = [call("post", "/v1/jobs", expect=202, body=body)[1]["id"] for body in heavy]
    call("delete", "/v1/volumes/{id}", expect=409, id=volume["id"])
    call("delete", "/v1/jobs/{id}", expect=200, id=jobs[-1])
    while state_of(jobs[0]) == "queued":
        time.sleep(0.01)
    call("delete", "/v1/jobs/{id}", expect=202, id=jobs[0])
    for name in jobs[1:-1]:
        urllib.request.urlopen(urllib.request.Request(f"{URL}/v1/jobs/{name}", method="DELETE"))
    while any(state_of(name) in ("queued", "running") for name in jobs):
        time.sleep(0.05)
    call("delete", "/v1/volumes/{id}/identity", expect=204, id=volume["id"])
    call("get", "/v1/models/{id}/{file}", expect=409, id=model, file="mesh.dcm")
    for kind, name in of_kind.items():
        call("delete", f"/v1/{kind}/{{id}}", expect=200, headers={"prefer": "return=representation"}, id=name)
    _, receipts = call("get", "/v1/erasures", expect=200)
    call("get", "/v1/erasures/{id}", expect=200, id=receipts["erasures"][0]["id"])
    call("get", "/v1/models/{id}", expect=410, id=model)
    call("get", "/v1/models/{id}", expect=404, id="mdl_" + "0" * 32)
    # What the documented examples name was there when it was asked for.
    walk.recorded["parameters"].update({f"/v1/{kind}/{{id}}": name for kind, name in of_kind.items()})
    walk.recorded["parameters"]["/v1/jobs/{id}"] = job["id"]
    access(walk)


def webhooks(walk, order):
    """A receiver that nobody listens at is registered, told about a job, told again and removed."""
    call = walk.call
    # `--webhook-allow 127.0.0.1` allows the receiver.
    nobody = {"url": "http://127.0.0.1:9/told", "events": ["succeeded"]}
    _, webhook = call("post", "/v1/webhooks", expect=201, body=nobody)
    call("get", "/v1/webhooks", expect=200)
    call("post", "/v1/webhooks/secret", expect=200)
    job = wait(walk, call("post", "/v1/jobs", expect=202, body={**order, "parameters": {"points": 20}})[1])
    _, told = call("get", "/v1/jobs/{id}/deliveries", expect=200, id=job["id"])
    while told["deliveries"][0]["attempts"] == 0:
        time.sleep(0.05)
        _, told = call("get", "/v1/jobs/{id}/deliveries", expect=200, id=job["id"])
    call(
        "post",
        "/v1/jobs/{id}/deliveries/{delivery}/redeliver",
        expect=202,
        id=job["id"],
        delivery=told["deliveries"][0]["id"],
    )
    call("delete", "/v1/webhooks/{id}", expect=204, id=webhook["id"])


def nuclear(image_type):
    """A Nuclear Medicine Image of four frames as a file, and its study."""
    data = pydicom.Dataset()
    data.SOPClassUID, data.SOPInstanceUID = NuclearMedicineImageStorage, generate_uid()
    data.StudyInstanceUID, data.SeriesInstanceUID = generate_uid(), generate_uid()
    data.Modality, data.ImageType = "NM", ["ORIGINAL", "PRIMARY", image_type, "EMISSION"]
    data.SamplesPerPixel, data.PhotometricInterpretation = 1, "MONOCHROME2"
    data.Rows, data.Columns, data.NumberOfFrames = 4, 4, 4
    data.PixelSpacing, data.SliceThickness, data.SpacingBetweenSlices = [4, 4], 4, 4
    data.BitsAllocated, data.BitsStored, data.HighBit, data.PixelRepresentation = 16, 16, 15, 0
    data.FrameIncrementPointer, data.SliceVector = 0x00540080, [1, 2, 3, 4]
    data.PixelData = bytes(128)
    data.file_meta = pydicom.dataset.FileMetaDataset()
    data.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
    file = io.BytesIO()
    data.save_as(file, enforce_file_format=True)
    return file.getvalue(), data.StudyInstanceUID


def received(walk):
    """Objects by STOW-RS: a volume, projections, none; what became of them."""
    call, one = walk.call, {"content-type": "application/dicom"}
    (scan, study), (projections, _) = nuclear("RECON TOMO"), nuclear("TOMO")
    parts = (
        b"".join(
            b"--m\r\nContent-Type: application/dicom\r\n\r\n" + part + b"\r\n" for part in (projections, b"no object")
        )
        + b"--m--\r\n"
    )
    related = {"content-type": 'multipart/related; type="application/dicom"; boundary=m'}
    for template, of in (("/dicom-web/studies", {}), ("/dicom-web/studies/{study}", {"study": study})):
        call("post", template, expect=200, body=scan, headers=one, **of)
        call("post", template, expect=409, body=b"no object", headers=one, **of)
        both = parts.replace(projections, scan)
        call("post", template, expect=202, body=both, headers=related, **of)
    call("post", "/dicom-web/studies", expect=406, body=scan, headers={**one, "accept": "application/dicom+xml"})
    call("post", "/dicom-web/studies", expect=202, body=parts, headers=related)
    while any(group["state"] in ("gathering", "filing") for group in intake(walk)):
        time.sleep(0.05)
    failed = [group["id"] for group in intake(walk) if group["state"] == "failed"]
    call("delete", "/v1/intake/{id}", expect=200, headers={"prefer": "return=representation"}, id=failed[0])


def intake(walk):
    walk.call("get", "/v1/receiving", expect=200)
    return walk.call("get", "/v1/intake", expect=200)[1]["intake"]


def access(walk):
    """Keys and the audit trail. Last, because the first key ends the access without one."""
    call = walk.call
    _, first = call("post", "/v1/keys", expect=201, body={"name": "contract", "scope": "admin"})
    walk.credentials = {"authorization": "Bearer " + first["key"]}
    _, second = call(
        "post", "/v1/keys", expect=201, body={"name": "scanner 2", "scope": "submit", "requests_per_minute": 600}
    )
    call("get", "/v1/keys", expect=200)
    call("get", "/v1/audit", expect=200, query="?limit=6")
    call("delete", "/v1/keys/{id}", expect=204, id=second["id"])
    call("delete", "/v1/keys", expect=422)
    call("delete", "/v1/keys", expect=200, query="?owner=contractor-7")
    # Without an issuer of tokens no key has an owner.
    walk.recorded["documents"]["RevokedKeys"] = {"revoked": [second["id"]]}
    walk.credentials = {"authorization": "Bearer " + second["key"]}
    call("get", "/v1/volumes", expect=401)
    # No key stands in a document that everybody reads.
    hide(walk.recorded)


def hide(value):
    """Replaces every secret by one that only looks like it."""
    if isinstance(value, dict):
        for name, part in value.items():
            if name in ("key", "secret") and isinstance(part, str):
                value[name] = SECRETS[name]
            else:
                hide(part)
    elif isinstance(value, list):
        for part in value:
            hide(part)


def state_of(job):
    try:
        return json.load(urllib.request.urlopen(f"{URL}/v1/jobs/{job}"))["state"]
    except urllib.error.HTTPError as error:
        # It had ended before it could be cancelled, so it was erased.
        if error.code == 410:
            return "erased"
        raise


def example_failures(contract):
    """Examples that do not satisfy their schemas, and operations without examples."""
    failures = []
    for path, method, operation in contract.operations():
        what = f"{method.upper()} {path}"
        if not operation.get("x-codeSamples"):
            failures.append(f"{what}: no example of a request")
        for parameter in operation.get("parameters", []):
            if parameter.get("in") == "path" and "example" not in parameter:
                failures.append(f"{what}: no example of {parameter['name']}")
        bodies = [("request", operation.get("requestBody", {})), *operation["responses"].items()]
        for status, body in bodies:
            for media_type, content in body.get("content", {}).items():
                examples = [e for e in [content.get("example")] if e is not None]
                for reference in content.get("examples", {}).values():
                    name = reference["$ref"].split("/")[-1]
                    examples.append(contract.document["components"]["examples"][name]["value"])
                if media_type.endswith("json") and media_type != "model/gltf+json" and not examples:
                    failures.append(f"{what} {status} {media_type}: no example")
                for example in examples:
                    for error in contract.errors(content["schema"], example, exact=False):
                        failures.append(f"{what} {status}: example: {error}")
        for name, file in operation.get("x-files", {}).items():
            schema = file["schema"].get("$ref", "").split("/")[-1]
            if schema and schema not in contract.document["components"]["examples"]:
                failures.append(f"{what} {name}: no example")
    return failures


def shape(value, path=""):
    """The paths of all fields of a document."""
    if isinstance(value, dict):
        return {path}.union(*(shape(part, f"{path}/{name}") for name, part in value.items()))
    if isinstance(value, list):
        return {path}.union(*(shape(part, path + "/-") for part in value))
    return {path}


def steady(recorded, committed):
    """What was recorded, or what is committed where that says as much."""
    kept = {}
    for name, value in recorded.items():
        old = committed.get(name)
        kept[name] = value if old is None or not shape(value) <= shape(old) else old
    return dict(sorted(kept.items()))


def main():
    target = sys.argv[2] if sys.argv[1:2] == ["--record"] else None
    # That it is the committed document is tested in tests/api.
    document = json.load(urllib.request.urlopen(f"{URL}/openapi.json"))
    validate(document)
    contract = Contract(document)
    names = [operation["operationId"] for _, _, operation in contract.operations()]
    failures = [f"operationId {name} is not unique" for name in set(names) if names.count(name) > 1]
    folder = os.environ["SERVICE_DATA"] + "/phantom"
    subprocess.run(
        [PROGRAM, "phantom", "-o", folder, "--size", "64", "--spacing", "6.4", "--seed", "1", "--projections"],
        check=True,
        capture_output=True,
    )
    walk = Walk(contract)
    everything(walk, folder)
    failures += walk.failures
    failures += [f"operation {name} was not tried" for name in names if name not in walk.seen]
    if target:
        for status, (code, detail, fix) in RARE.items():
            title = code.replace("-", " ").capitalize()
            problem = {
                "type": f"urn:ventriform:problem:{code}",
                "title": title,
                "status": int(status),
                "detail": detail,
            }
            walk.recorded["problems"].setdefault(status, {**problem, **({"fix": fix} if fix else {})})
        problem = {**walk.recorded["problems"]["503"], "detail": NOT_READY[0]["detail"], "checks": NOT_READY}
        walk.recorded["operations"]["ready"] = {"503": {PROBLEM: problem}}
        committed = json.load(open(EXAMPLES))
        schemas = document["components"]["schemas"]
        committed["documents"] = {
            name: value
            for name, value in committed["documents"].items()
            if name in schemas and not contract.errors({"$ref": f"#/components/schemas/{name}"}, value, exact=True)
        }
        kept = {group: steady(values, committed.get(group, {})) for group, values in walk.recorded.items()}
        with open(target, "w") as file:
            json.dump(kept, file, indent=1, ensure_ascii=False)
            file.write("\n")
    else:
        failures += example_failures(contract)
    print(*failures, sep="\n")
    print(f"{len(names)} operations, {len(failures)} failures")
    sys.exit(bool(failures))


main()
