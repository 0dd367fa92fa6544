"""Modes of the comparison's building in a process of their own: SIZE MODES RESULT.json.

A process of its own shows its own peak memory, and starts as OpenSees does.
"""

import json
import sys
import time
from pathlib import Path

import numpy as np

from femupdate.fe import assemble, lowest_modes

from .tower import tower


def run(per_bay: int, modes: int) -> dict[str, object]:
    """Frequencies with the seconds of each step."""
    wall, cpu = [time.perf_counter()], [time.process_time()]

    def lap() -> None:
        wall.append(time.perf_counter())
        cpu.append(time.process_time())

    structure = tower(per_bay)
    lap()
    operators = assemble(structure)
    lap()
    found = lowest_modes(operators, np.ones(operators.parameters), modes)
    lap()
    return {
        "frequencies_hz": found.frequency_hz.tolist(),
        "seconds": wall[-1] - wall[0],
        "cpu_seconds": cpu[-1] - cpu[0],
        "cpu_steps": dict(zip(("mesh", "assembly", "modes"), np.diff(cpu).tolist(), strict=True)),
        "dof": len(operators.free),
    }


if __name__ == "__main__":
    result = run(int(sys.argv[1]), int(sys.argv[2]))
    Path(sys.argv[3]).write_text(json.dumps(result), encoding="utf-8")
