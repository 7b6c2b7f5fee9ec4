#!/usr/bin/env python3
"""Upgrades a service of several replicas, one replica after the other, while it works.

    scripts/check/upgrade.py --old OLD_PROGRAM --new NEW_PROGRAM        (scripts/check/upgrade.sh builds both)

Two replicas answer requests and two compute, over PostgreSQL and an S3 store (moto), all of the old version. Under the
load of scripts/check/chaos.py, one of each role becomes the new version, whose start changes the tables; then one that
stayed old is started once more, as a crash would; then the others become new. At the end everything acknowledged is
read back, as scripts/check/chaos.py does it. A request may meet a closed connection or 503, which its client repeats,
and no other fault.

Needs what scripts/check/chaos.py needs. The last line is a JSON object; the exit status is 0 if nothing was lost.
"""

import argparse
import json
import os
import random
import sys
import tempfile

import chaos
from chaos import Chaos


class Upgrade(Chaos):
    def __init__(self, options, folder, scan):
        super().__init__(options, folder, scan)
        self.kinds = []

    def separate(self):
        """All replicas share this machine's network."""

    def replace(self, *names):
        """Stops replicas in order and starts them again, of the version that is to be."""
        for name in names:
            self.services[name].stop()
            self.start(name)

    def step(self, what, program, *names):
        self.program = program
        self.under_load(lambda: self.replace(*names))
        self.figures["rounds"] += 1
        versions = self.postgres.query("SELECT max(version) FROM _sqlx_migrations")[0][0]
        print(f"{what}: tables of version {versions}, {self.figures['refused']} requests refused", flush=True)
        return versions


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--old", required=True)
    parser.add_argument("--new", required=True)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--jobs", type=int, default=chaos.JOBS, help="jobs of a step; fewer for programs that are not optimised"
    )
    options = parser.parse_args()
    chaos.JOBS = options.jobs
    options.only, options.program = None, options.old
    random.seed(options.seed)
    folder = tempfile.mkdtemp(prefix="ventriform-upgrade-")
    os.chmod(folder, 0o755)
    scan = chaos.simulated_scan(options.new, folder)
    upgrade = Upgrade(options, folder, scan)
    try:
        upgrade.build()
        before = upgrade.step("all old", options.old)
        after = upgrade.step("half new", options.new, "worker-1", "api-1")
        upgrade.step("an old one started once more", options.old, "api-0", "worker-0")
        upgrade.step("half new", options.new)
        upgrade.step("all new", options.new, "api-0", "worker-0")
        upgrade.check()
    finally:
        upgrade.tear_down()
    print(json.dumps(upgrade.figures | {"tables_before": before, "tables_after": after}))
    return chaos.status(upgrade.figures, folder)


if __name__ == "__main__":
    sys.exit(main())
