"""Runs contestants in turns and measures the time of each turn.

A contestant is a function of the round's number that does its work once and returns
(wall ms, processor ms). After a warm-up, all contestants run one after the other in every round, so
that other load on the machine affects all of them alike. Ratios are taken within a round; their median
is reported.
"""

import json
import os
import statistics
import subprocess
import time


class Ours:
    """The tool `stopwatch` as a running process; see crates/evaluation/src/bin/stopwatch.rs."""

    def __init__(self, binary, threads=1):
        environment = dict(os.environ, RAYON_NUM_THREADS=str(threads))
        self.process = subprocess.Popen(
            [binary], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment
        )

    def ask(self, *words):
        """Sends a command. Returns the answer, with `cpu_ms`, the processor time of all threads."""
        before = self.cpu_ms()
        self.process.stdin.write(" ".join(str(w) for w in words) + "\n")
        self.process.stdin.flush()
        line = self.process.stdout.readline()
        if not line:
            raise RuntimeError(f"stopwatch ended without an answer to `{' '.join(map(str, words))}`")
        answer = json.loads(line)
        answer["cpu_ms"] = self.cpu_ms() - before
        return answer

    def cpu_ms(self):
        """Processor time of all threads so far, ms. Read from schedstat: getrusage counts in ticks."""
        tasks = f"/proc/{self.process.pid}/task"
        total = 0
        for task in os.listdir(tasks):
            with open(f"{tasks}/{task}/schedstat") as file:
                total += int(file.read().split()[0])
        return total / 1e6

    def peak_mib(self):
        """Peak resident memory of the process (VmHWM), MiB."""
        with open(f"/proc/{self.process.pid}/status") as file:
            line = next(line for line in file if line.startswith("VmHWM"))
        return int(line.split()[1]) / 1024

    def turn(self, *words, without=()):
        """A contestant that sends the command `words`, which may contain functions of the round's
        number. The time of the stages `without` is subtracted; the process must have one thread."""

        def run(number):
            asked = [w(number) if callable(w) else w for w in words]
            answer = self.ask(*asked)
            off = sum(answer["stages_ms"][stage] for stage in without)
            return answer["wall_ms"] - off, answer["cpu_ms"] - off

        return run

    def close(self):
        self.process.stdin.close()
        self.process.wait()


def timed(work):
    """A contestant that calls a Python function without arguments."""

    def run(_):
        wall, cpu = time.perf_counter(), time.process_time()
        work()
        return 1e3 * (time.perf_counter() - wall), 1e3 * (time.process_time() - cpu)

    return run


def in_turn(contestants, rounds):
    """Runs all contestants `rounds` times. Returns the median times of each, and the median over the
    rounds of its time over the first contestant's."""
    for run in contestants.values():
        run(0)
    seen = {name: [] for name in contestants}
    for number in range(1, rounds + 1):
        for name, run in contestants.items():
            seen[name].append(run(number))
    first = next(iter(contestants))
    result = {}
    for name, times in seen.items():
        wall, cpu = zip(*times)
        result[name] = {
            "runs": rounds,
            "wall_ms": statistics.median(wall),
            "wall_ms_least": min(wall),
            "cpu_ms": statistics.median(cpu),
            "wall_ratio": statistics.median(t[0] / o[0] for t, o in zip(times, seen[first])),
            "cpu_ratio": statistics.median(t[1] / o[1] for t, o in zip(times, seen[first])),
        }
    return result


def show(title, result):
    """Prints the contestants as a table."""
    print(f"\n{title}")
    print(f"  {'':34} {'wall ms':>9} {'least':>9} {'cpu ms':>9} {'ratio':>7} {'by cpu':>7}")
    for name, r in result.items():
        print(
            f"  {name:34} {r['wall_ms']:9.2f} {r['wall_ms_least']:9.2f} {r['cpu_ms']:9.2f}"
            f" {r['wall_ratio']:7.2f} {r['cpu_ratio']:7.2f}",
            flush=True,
        )
