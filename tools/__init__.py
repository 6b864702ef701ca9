"""Training, benchmarks, studies and generated documentation; `python -m tools` lists the commands."""
