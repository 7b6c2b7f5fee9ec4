#!/usr/bin/env python3
"""Checks rendered manifests of Kubernetes on standard input: schemas, hardening, and settings the program knows.

    kubectl kustomize deploy/kubernetes | scripts/check/kubernetes.py target/debug/ventriform

Every object fits the schemas of every version of Kubernetes that kubernetes_validate has, unknown fields forbidden.
Every container runs as a user that is not root, on a read-only root, without capabilities, with probes and limits, and
has no secret but by reference. Selectors find pods. Every setting in a variable and every flag is accepted by the
program. Exits with 1 and the list of what is wrong.
"""

import os
import subprocess
import sys

import kubernetes_validate
import yaml
from kubernetes_validate import utils

VERSIONS = list(dict.fromkeys(utils.major_minor(version) for version in utils.all_versions()))

program = sys.argv[1]
objects = [item for item in yaml.safe_load_all(sys.stdin) if item]
wrong = []


def say(item, text):
    wrong.append(f"{item['kind']} {item['metadata']['name']}: {text}")


for item in objects:
    for version in VERSIONS:
        try:
            kubernetes_validate.validate(item, version, strict=True)
        except (kubernetes_validate.ValidationError, kubernetes_validate.SchemaNotFoundError) as error:
            say(item, f"Kubernetes {version}: {getattr(error, 'message', error)}")
            break

deployments = [item for item in objects if item["kind"] == "Deployment"]
settings = {key: value for item in objects if item["kind"] == "ConfigMap" for key, value in item["data"].items()}
maps = {item["metadata"]["name"] for item in objects if item["kind"] == "ConfigMap"}


def check_container(item, pod, container):
    security = {**pod.get("securityContext", {}), **container.get("securityContext", {})}
    for field, due in {
        "runAsNonRoot": True,
        "readOnlyRootFilesystem": True,
        "allowPrivilegeEscalation": False,
        "capabilities": {"drop": ["ALL"]},
    }.items():
        if security.get(field) != due:
            say(item, f"{field} is {security.get(field)}, not {due}")
    if pod.get("automountServiceAccountToken") is not False:
        say(item, "mounts the token of its service account")
    for probe in ("startupProbe", "livenessProbe", "readinessProbe"):
        if probe not in container:
            say(item, f"has no {probe}")
    resources = container.get("resources", {})
    if "memory" not in resources.get("limits", {}) or "cpu" not in resources.get("requests", {}):
        say(item, "requests no processor or has no limit of memory")
    for variable in container.get("env", []):
        name = variable["name"]
        if any(
            word in name for word in ("SECRET", "KEY", "PASSWORD", "DATABASE")
        ) and "secretKeyRef" not in variable.get("valueFrom", {}):
            say(item, f"{name} is written out, not taken from a secret")
    for source in container.get("envFrom", []):
        if source["configMapRef"]["name"] not in maps:
            say(item, f"there is no map {source['configMapRef']['name']}")
    # The program reads the flags and the variables, or says which one it does not know.
    variables = dict(settings)
    for variable in container.get("env", []):
        variables[variable["name"]] = (
            "postgres://user@db/ventriform" if variable["name"] == "VENTRIFORM_DATABASE" else "some"
        )
    unknown = [name for name in variables if name.startswith("VENTRIFORM_") and not known(name)]
    if unknown:
        say(item, f"the program has no setting {', '.join(unknown)}")
    answer = subprocess.run(
        [program, *container["args"], "--print-config"], env={**os.environ, **variables}, capture_output=True, text=True
    )
    if answer.returncode:
        say(item, f"the program refuses its settings: {answer.stderr.strip()}")


def known(variable):
    flag = "--" + variable.removeprefix("VENTRIFORM_").lower().replace("_", "-")
    return f"{flag} " in HELP or f"{flag}\n" in HELP


HELP = subprocess.run([program, "serve", "--help"], capture_output=True, text=True, check=True).stdout
for item in deployments:
    template = item["spec"]["template"]
    for container in template["spec"]["containers"]:
        check_container(item, template["spec"], container)
    if not item["spec"]["selector"]["matchLabels"].items() <= template["metadata"]["labels"].items():
        say(item, "its selector does not find its own pods")

labels = [item["spec"]["template"]["metadata"]["labels"] for item in deployments]
for item in objects:
    spec = item.get("spec", {})
    selector = {
        "Service": lambda: spec["selector"],
        "PodDisruptionBudget": lambda: spec["selector"]["matchLabels"],
        "NetworkPolicy": lambda: spec["podSelector"]["matchLabels"],
    }.get(item["kind"])
    if selector and not any(selector().items() <= found.items() for found in labels):
        say(item, f"finds no pods by {selector()}")
    if item["kind"] == "HorizontalPodAutoscaler" and spec["scaleTargetRef"]["name"] not in [
        d["metadata"]["name"] for d in deployments
    ]:
        say(item, "scales nothing")
    if item["kind"] == "Secret":
        say(item, "a secret is written out")

for text in wrong:
    print(text)
if not deployments:
    sys.exit("nothing was rendered")
print(f"{len(objects)} objects, Kubernetes {VERSIONS[0]} to {VERSIONS[-1]}: {len(wrong)} wrong")
sys.exit(bool(wrong))
