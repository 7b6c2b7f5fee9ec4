"""Normal limits judged on simulated hearts that took no part in them.

    python scripts/measure/judge_normals.py OUT --seed 3720
        [--protocol stress_nac] [--programs target/release]

Makes, under OUT and with seeds from --seed on, healthy hearts for the limits (30), healthy hearts (20), hearts with one
defect (20) and hearts with one dark basal segment (18) to judge by, with the program `simulate`; what is there already
is kept. Then runs `ventriform normals build` and the instrument `perfusion`, whose page says what
the figures are. Constants were chosen on seeds 3701 to 3704 and 3711 to 3714: say which seeds a figure is of.
"""

import argparse
import subprocess

HEALTHY, DEFECTS, BASAL, NORMALS = 20, 20, 18, 30


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out")
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--protocol", default="stress_nac")
    parser.add_argument("--programs", default="target/release")
    given = parser.parse_args()

    def make(name, seed, number, *more):
        subprocess.run(
            [
                f"{given.programs}/simulate",
                "healthy",
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
    make("basal", given.seed + 4, BASAL, "--basal")
    limits = f"{given.out}/normals.json"
    subprocess.run(
        [f"{given.programs}/ventriform", "normals", "build", f"{given.out}/normals", "-o", limits], check=True
    )
    judged = [f"{given.out}/{name}" for name in ("healthy", "defects", "basal")]
    subprocess.run([f"{given.programs}/perfusion", limits, *judged], check=True)


if __name__ == "__main__":
    main()
