"""A Dask scheduler with two workers on loopback. It prints its address, and ends with its standard input."""

import sys

from distributed import LocalCluster

if __name__ == "__main__":
    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": "127.0.0.1:0"}
    with LocalCluster(**options, preload=sys.argv[1:]) as cluster:
        print(cluster.scheduler_address, flush=True)
        sys.stdin.read()
