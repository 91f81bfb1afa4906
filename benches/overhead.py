"""What a whole run costs beside its steps: Python, history, output every 0.5 D/U, checkpoints.

    python benches/overhead.py

Steps alone and whole runs of the cylinder at D/Δx = 20 to t* = 1 take turns; the median of the ratios counts.
"""

import statistics
import tempfile
import time

import alsph

ROUNDS, UNTIL, THREADS = 3, 1.0, 2

case = alsph.cases.Cylinder(reynolds=200, resolution=20)
ratios = []
for _ in range(ROUNDS):
    start = time.perf_counter()
    case.simulation(threads=THREADS).run_until(UNTIL)
    alone = time.perf_counter() - start
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        case.run(f"{folder}/run", until=UNTIL, threads=THREADS)
        whole = time.perf_counter() - start
    ratios.append(whole / alone)
    print(f"steps alone {alone:.1f} s, whole run {whole:.1f} s: {whole / alone - 1:+.1%}")
print(f"median {statistics.median(ratios) - 1:+.1%}")
