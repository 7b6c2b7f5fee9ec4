"""Upload, make a model and a beat, wait, download, and meet an error, by a generated Python client.

SERVICE_URL=... PYTHONPATH=<folder of ventriform_client> python try_client.py scan.nii.gz gated.nii.gz
"""

import importlib
import io
import os
import pkgutil
import sys
import time

import ventriform_client
from ventriform_client import Client
from ventriform_client.api.beats import get_beat, get_beat_file, get_beat_report, list_beats
from ventriform_client.api.jobs import create_job, get_job
from ventriform_client.api.models import get_model, get_model_file, get_model_report, list_models
from ventriform_client.api.volumes import create_volume, get_volume
from ventriform_client.models import (
    Beat,
    BeatJobRequest,
    BeatParameters,
    BeatReport,
    Job,
    JobState,
    Model,
    ModelFileName,
    ModelJobRequest,
    ModelParameters,
    ModelReport,
    Problem,
    Volume,
)
from ventriform_client.types import File

# Every module of the client can be imported.
modules = [m.name for m in pkgutil.walk_packages(ventriform_client.__path__, "ventriform_client.")]
for name in modules:
    importlib.import_module(name)

# Other checks run beside this one, and CI may be slow.
JOB_SECONDS = 600

client = Client(base_url=os.environ["SERVICE_URL"])


def stored(path):
    """The volume of a file."""
    volume = create_volume.sync(client=client, body=File(payload=io.BytesIO(open(path, "rb").read())))
    assert isinstance(volume, Volume), volume
    return volume


def made(kind, volume, parameters):
    """The job of that kind, when it has succeeded."""
    requests = {"model": ModelJobRequest, "beat": BeatJobRequest}
    request = requests[kind].from_dict({"kind": kind, "volume": volume.id})
    request.parameters = parameters
    job = create_job.sync(client=client, body=request)
    assert isinstance(job, Job), job
    deadline = time.time() + JOB_SECONDS
    while job.state in (JobState.QUEUED, JobState.RUNNING):
        assert time.time() < deadline, job
        time.sleep(0.05)
        job = get_job.sync(client=client, id=job.id)
    assert job.state == JobState.SUCCEEDED, job
    return job


volume = stored(sys.argv[1])
assert volume.gates is None, volume
job = made("model", volume, ModelParameters(points=110, seed=3))
model = get_model.sync(client=client, id=job.model)
assert isinstance(model, Model) and model.summary.vertices == 110, model
assert model.parameters.points == 110, model.parameters
mesh = get_model_file.sync(client=client, id=model.id, file=ModelFileName.MESH_GLB)
assert mesh.payload.read(4) == b"glTF"
report = get_model_report.sync(client=client, id=model.id)
assert isinstance(report, ModelReport) and report.mesh.vertices == 110, report
assert report.distance.mean_mm < 5 and report.shape.radius_ratio.mean > 0.5
assert model.id in [m.id for m in list_models.sync(client=client).models]

gated = stored(sys.argv[2])
assert gated.gates.number == 8, gated
job = made("beat", gated, BeatParameters(rr_ms=900.0))
beat = get_beat.sync(client=client, id=job.beat)
assert isinstance(beat, Beat) and beat.summary.gates == 8 and beat.parameters.rr_ms == 900, beat
report = get_beat_report.sync(client=client, id=beat.id)
assert isinstance(report, BeatReport) and len(report.gates) == 8 and len(report.segments) == 17, report
assert report.edv_ml > report.esv_ml and report.ef_percent == beat.summary.ef_percent, report
assert get_beat_file.sync(client=client, id=beat.id, file="mesh_gate01.glb").payload.read(4) == b"glTF"
assert beat.id in [b.id for b in list_beats.sync(client=client).beats]

problem = get_volume.sync(client=client, id="vol_" + "0" * 32)
assert isinstance(problem, Problem) and problem.status == 404 and problem.title, problem
print(f"ok: {len(modules)} modules imported; uploaded, waited, downloaded, and read a problem")
