"""Upload, make a model, wait, download, and meet an error, by a generated Python client.

    SERVICE_URL=... PYTHONPATH=<folder of ventriform_client> python try_client.py scan.nii.gz
"""
import importlib, io, os, pkgutil, sys, time

import ventriform_client
from ventriform_client import Client
from ventriform_client.api.jobs import create_job, get_job
from ventriform_client.api.models import get_model, get_model_mesh_glb, get_model_report, list_models
from ventriform_client.api.volumes import create_volume, get_volume
from ventriform_client.models import Job, JobState, Model, ModelReport, Problem, Volume, VolumeJobRequest
from ventriform_client.types import File

# Every module of the client can be imported.
modules = [m.name for m in pkgutil.walk_packages(ventriform_client.__path__, "ventriform_client.")]
for name in modules:
    importlib.import_module(name)

client = Client(base_url=os.environ["SERVICE_URL"])
scan = open(sys.argv[1], "rb").read()

volume = create_volume.sync(client=client, body=File(payload=io.BytesIO(scan)))
assert isinstance(volume, Volume), volume
request = VolumeJobRequest.from_dict({"kind": "model", "volume": volume.id, "parameters": {"points": 110, "seed": 3}})
job = create_job.sync(client=client, body=request)
assert isinstance(job, Job), job
deadline = time.time() + 60
while job.state in (JobState.QUEUED, JobState.RUNNING):
    assert time.time() < deadline, job
    time.sleep(0.05)
    job = get_job.sync(client=client, id=job.id)
assert job.state == JobState.SUCCEEDED, job
model = get_model.sync(client=client, id=job.model)
assert isinstance(model, Model) and model.summary.vertices == 110, model
assert model.parameters.points == 110, model.parameters
mesh = get_model_mesh_glb.sync(client=client, id=model.id)
assert mesh.payload.read(4) == b"glTF"
report = get_model_report.sync(client=client, id=model.id)
assert isinstance(report, ModelReport) and report.mesh.vertices == 110, report
assert report.distance.mean_mm < 5 and report.shape.radius_ratio.mean > 0.5
assert model.id in [m.id for m in list_models.sync(client=client).models]
problem = get_volume.sync(client=client, id="vol_" + "0" * 32)
assert isinstance(problem, Problem) and problem.status == 404 and problem.title, problem
print(f"ok: {len(modules)} modules imported; uploaded, waited, downloaded, and read a problem")
