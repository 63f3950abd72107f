"""What every benchmark has."""

import subprocess
import sys

from materialist_lab.bench.benchmark import timed

BUSY = "import time\nwhile time.process_time() < 0.3: pass"


def test_processor_seconds_count_other_processes():
    done, cost = timed(subprocess.run, [sys.executable, "-c", BUSY], check=True)
    assert done.returncode == 0 and cost["cpu_seconds"] >= 0.28 and cost["seconds"] > 0
