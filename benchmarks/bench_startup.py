"""How long robotctl takes to start, beside what Python and typer take alone, in one run.

python benchmarks/bench_startup.py
"""

from __future__ import annotations

import subprocess
import sys
import time

TARGET_S = 0.15
ROUNDS = 15
COMMANDS = {
    "python alone": ("-c", "pass"),
    "with typer": ("-c", "import typer"),
    "robotctl --help": ("-m", "cli.main", "--help"),
    "robotctl goal add --help": ("-m", "cli.main", "goal", "add", "--help"),
    "robotctl robots, and no router": ("-m", "cli.main", "robots", "--router", "tcp/127.0.0.1:1"),
}


def main() -> None:
    """Print the best of several rounds, in which the commands take turns."""
    best = dict.fromkeys(COMMANDS, float("inf"))
    for _ in range(ROUNDS):
        for name, arguments in COMMANDS.items():
            started = time.perf_counter()
            subprocess.run([sys.executable, *arguments], capture_output=True, check=False)
            best[name] = min(best[name], time.perf_counter() - started)
    print("| what | best of rounds | times Python alone |\n| --- | --- | --- |")
    for name, seconds in best.items():
        print(f"| {name} | {seconds * 1000:.0f} ms | {seconds / best['python alone']:.1f} |")
    print(f"\nThe target for `--help` is {TARGET_S * 1000:.0f} ms; without a router, 3 s.")


if __name__ == "__main__":
    main()
