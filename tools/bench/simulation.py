"""CPU time of the simulator: building a world, the first sweep, later sweeps, and a reference workload.

    python -m tools.bench.simulation [--scene NAME] [--sensor NAME] [--sweeps N] [--seed S]

The reference workload, sorting a million random numbers, relates figures of different machines. Run on one core with
OMP_NUM_THREADS=1.
"""

from __future__ import annotations

import json
import resource
import time

import numpy as np

from modt_desk.simulation.synthetic_stream import SyntheticStream
from tools.options import parser


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--scene", default="street")
    options.add_argument("--sensor", default="hdl-64e")
    options.add_argument("--sweeps", type=int, default=50)
    options.add_argument("--seed", type=int, default=0)
    args = options.parse_args()
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
