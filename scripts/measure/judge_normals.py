"""Normal limits judged on simulated hearts that took no part in them.

    python scripts/measure/judge_normals.py SIMULATOR OUT --seed 3720
        [--protocol stress_nac] [--programs target/release]

SIMULATOR is the folder of make_healthy.py. Makes, under OUT and with seeds from --seed on, healthy hearts for the
limits (30), healthy hearts (20), hearts with one defect (20) and hearts with one dark basal segment (18) to judge by;
what is there already is kept. Then runs `ventriform normals build` and the instrument `perfusion`, whose page says what
the figures are. Constants were chosen on seeds 3701 to 3704 and 3711 to 3714: say which seeds a figure is of.
"""

import argparse
import os
import subprocess
import sys

HEALTHY, DEFECTS, BASAL, NORMALS = 20, 20, 18, 30


def make_basal(simulator, out, seed, protocol):
    """Hearts of make_healthy.py with one of segments 1 to 6 dark by 40 to 95 per cent, and their cohort.csv."""
    sys.path.insert(0, simulator)
    import make_healthy

    def one_segment(rng):
        return dict(
            territory="basal",
            segments=[int(rng.integers(1, 7))],
            severity=round(float(rng.uniform(0.4, 0.95)), 3),
            shift_theta=round(float(rng.normal(0, 8)), 1),
            shift_mu=round(float(rng.normal(0, 3)), 1),
            akinesia=0.0,
            thinning=0.0,
        )

    make_healthy.one_defect = one_segment
    for number in range(BASAL):
        name = f"b{seed}_{number:03d}"
        if not os.path.exists(f"{out}/{name}/params.json"):
            make_healthy.make(name, 1000 * seed + number, out, "MF"[number % 2], protocol, 0, True)
    make_healthy.table(out)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("simulator")
    parser.add_argument("out")
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--protocol", default="stress_nac")
    parser.add_argument("--programs", default="target/release")
    given = parser.parse_args()
    os.environ.setdefault("NUMBA_NUM_THREADS", "1")

    def make(name, seed, number, *more):
        subprocess.run(
            [
                sys.executable,
                f"{given.simulator}/make_healthy.py",
                "--out",
                f"{given.out}/{name}",
                "--seed",
                str(seed),
                "--n",
                str(number),
                "--protocol",
                given.protocol,
                *more,
            ],
            check=True,
        )

    make("normals", given.seed + 1, NORMALS)
    make("defects", given.seed + 2, DEFECTS, "--one-defect")
    make("healthy", given.seed + 3, HEALTHY)
    make_basal(given.simulator, f"{given.out}/basal", given.seed + 4, given.protocol)
    limits = f"{given.out}/normals.json"
    subprocess.run(
        [f"{given.programs}/ventriform", "normals", "build", f"{given.out}/normals", "-o", limits], check=True
    )
    judged = [f"{given.out}/{name}" for name in ("healthy", "defects", "basal")]
    subprocess.run([f"{given.programs}/perfusion", limits, *judged], check=True)


if __name__ == "__main__":
    main()
