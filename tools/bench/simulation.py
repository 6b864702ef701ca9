"""What a synthetic sweep costs: CPU time to build the world, to the first frame and a sweep, beside a yardstick.

    python -m tools.bench.simulation [--scene NAME] [--sensor NAME] [--sweeps N] [--seed S]

The yardstick (sorting a million random numbers) tells a fast machine from a slow one. Run on one core with
OMP_NUM_THREADS=1.
"""

from __future__ import annotations

import argparse
import json
import resource
import time

import numpy as np

from modt.sources.synthetic_stream import SyntheticStream


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", default="street")
    parser.add_argument("--sensor", default="hdl-64e")
    parser.add_argument("--sweeps", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    marks = [time.process_time()]
    stream = SyntheticStream(args.scene, args.sensor, 10.0, args.seed)
    marks.append(time.process_time())
    stream.simulator.sweep(0)
    marks.append(time.process_time())
    bodies, cost = [], []
    for i in range(args.sweeps):
        started = time.process_time()
        _, truth = stream.simulator.sweep(i % 100)
        cost.append(1e3 * (time.process_time() - started))
        bodies.append(
            int((np.hypot(truth.boxes[:, 0], truth.boxes[:, 1]) < stream.simulator.sensor.max_range_m).sum())
        )
    numbers = np.random.default_rng(0).random(1_000_000)
    started = time.process_time()
    np.sort(numbers)
    report = {
        "build_ms": 1e3 * (marks[1] - marks[0]),
        "first_sweep_ms": 1e3 * (marks[2] - marks[1]),
        "sweep_ms_median": float(np.median(cost)),
        "sweep_ms_95": float(np.percentile(cost, 95)),
        "annotated_bodies_in_reach": float(np.mean(bodies)),
        "all_bodies": len(stream.simulator.world.bodies),
        "sort_million_ms": 1e3 * (time.process_time() - started),
        "peak_memory_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }
    print(json.dumps({k: round(v, 1) for k, v in report.items()}))


if __name__ == "__main__":
    main()
