"""The record of figures: its observations, how it compares, what it measures."""

import json
import sys

import pytest
from femupdate.benchmarks.regression import run
from femupdate.benchmarks.regression.compare import compare_records
from femupdate.benchmarks.result import Job
from femupdate.benchmarks.usage import measure


def kept(processor_seconds=10.0, status="finished", peak_mb=100, **figures):
    seconds = {"seconds": 5.0, "processor_seconds": processor_seconds}
    usage = {**seconds, "peak_mb": peak_mb}
    return {"run": {"status": status, **usage, "figures": figures}}


def broken(before, after):
    return [row.figure for row in compare_records(before, after) if row.broken]


@pytest.mark.parametrize(
    ("kind", "before", "within", "beyond"),
    [
        ("same", "named", "named", "none"),
        ("digits", 5.0, 5.0 * (1.0 + 5e-10), 5.0 * (1.0 + 2e-9)),
        ("posterior", [1.0, 0.1], [1.009, 0.104], [1.011, 0.1]),
        ("posterior", [1.0, 0.1], [1.0, 0.096], [1.0, 0.094]),
        ("evidence", [-50.0, 0.3], [-49.6, 0.4], [-49.4, 0.4]),
        ("interval", [3.0, 2.0, 4.0], [3.05, 2.1, 3.9], [3.0, 2.0, 4.2]),
    ],
)
def test_each_kind_of_figure_has_its_tolerance(kind, before, within, beyond):
    records = [kept(**{kind: {"figure": value}}) for value in (before, within, beyond)]
    assert broken(records[0], records[1]) == []
    assert broken(records[0], records[2]) == ["run: figure"]


def test_slower_or_no_longer_finished_breaks_a_tolerance():
    assert broken(kept(10.0), kept(24.0)) == []
    assert broken(kept(10.0), kept(26.0)) == ["run: processor s"]
    assert broken(kept(peak_mb=500), kept(peak_mb=1990)) == []
    assert broken(kept(peak_mb=500), kept(peak_mb=2010)) == ["run: peak MB"]
    assert broken(kept(), kept(status="unfinished")) == ["run"]
    assert broken(kept(status="unfinished"), kept()) == []


def test_workers_are_measured_and_a_limit_stops_them(tmp_path):
    spin = "t = time.process_time()\nwhile time.process_time() - t < {}: pass\n"
    worker = f"import time\nkept = bytearray(60_000_000)\n{spin.format(0.6)}"
    start = f"worker = subprocess.Popen([sys.executable, '-c', {worker!r}])\n"
    code = f"import subprocess, sys, time\n{start}{spin.format(0.3)}worker.wait()"
    command = [sys.executable, "-c", code]
    whole = measure(command, {}, tmp_path, tmp_path / "log", limit_s=20.0)
    assert whole.ended == 0
    assert whole.processor_seconds > 0.8
    assert whole.peak_mb > 60.0
    assert measure(command, {}, tmp_path, tmp_path / "log", limit_s=0.2).ended is None


def test_a_figure_that_has_fallen_is_marked(tmp_path):
    """The cheapest run against its own figures, then against one that is a little different."""
    job, none = Job(tmp_path), tmp_path / "none.json"
    none.write_text('{"runs": {}}')
    report, fallen = run.run_regression(job, none, True, "model shear_3dof")
    assert fallen == 0
    found = report.content()
    first = found["runs"]["model shear_3dof"]["figures"]["digits"]
    first["frequency 1 Hz"] *= 1.001
    changed = tmp_path / "changed.json"
    changed.write_text(json.dumps(found))
    report, fallen = run.run_regression(job, changed, True, "model shear_3dof")
    assert fallen == 1
    marked = [line for line in report.text.splitlines() if line.endswith("| ! |")]
    assert len(marked) == 1
    assert "frequency 1 Hz" in marked[0]
