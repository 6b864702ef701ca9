"""CPU time of the ledger: per stage, per frame, and relative to a frame of a recorded stream."""

from __future__ import annotations

import time
from pathlib import Path

from modt import host, profile
from modt.cli.options import frames
from tools.options import parser


def main() -> None:
    options = parser(__doc__)
    options.add_argument("path", nargs="?", type=Path, help="stream (default: the embedded one)")
    options.add_argument("--frames", type=frames, default=(0, 60), metavar="A:B")
    options.add_argument("--fov", choices=("camera", "full"), default="full")
    options.add_argument("--repeat", type=int, default=2000, help="frames of empty stages")
    arguments = options.parse_args()
    host.pin_to_core(host.last_core())
    from modt.app import assembly, inputs
    from modt.energy.ledger import STAGES, Ledger, NullLedger

    ledger = Ledger()
    print(f"calibrated by the ledger: {ledger.span_overhead_ns} ns per call, {ledger.frame_overhead_ns} ns per frame")
    empty_us = {}
    for name, books in (("ledger", ledger), ("null", NullLedger())):
        began_ns = time.thread_time_ns()
        for index in range(arguments.repeat):
            for stage in STAGES:
                books.run(stage, len, ())
            books.close_frame(index)
        empty_us[name] = 1e-3 * (time.thread_time_ns() - began_ns) / arguments.repeat
    cost_us = empty_us["ledger"] - empty_us["null"]
    print(f"a frame of {len(STAGES)} empty stages: {cost_us:.1f} us more than with the null ledger")
    request = inputs.Request(path=arguments.path, fov=arguments.fov, frames=arguments.frames)
    stream = inputs.stream(request)
    for mode in assembly.MODES:
        chosen, loaded = assembly.MODES[mode], profile.load()
        pipeline = assembly.pipeline(chosen, loaded, inputs.field_of_view(request, stream.info), ledger)
        count = cpu_ns = 0
        budget = chosen.budget(loaded)
        for frame in stream:
            began_ns = time.thread_time_ns()
            pipeline.step(frame, budget)
            ledger.close_frame(frame.index)
            cpu_ns += time.thread_time_ns() - began_ns
            count += 1
        share = 1e3 * cost_us * count / cpu_ns
        print(f"{mode:<14}{1e-6 * cpu_ns / count:8.2f} ms a frame; the ledger is {100 * share:.3f} %")


if __name__ == "__main__":
    main()
