"""The benchmark `fuzz`: its mutations, and a few mutated files of every kind."""

import os
from dataclasses import replace

import numpy as np
import pytest
from femupdate.benchmarks.fuzz import run
from femupdate.benchmarks.fuzz.mutate import MUTATIONS, mutated
from femupdate.benchmarks.fuzz.seeds import write_seeds
from femupdate.benchmarks.fuzz.subjects import SUBJECTS, seed_folders, subject, target_of
from femupdate.benchmarks.fuzz.worker import case, outcome
from femupdate.benchmarks.result import Job

from femupdate.errors import BuildingError

EACH = 12  # mutated files of a kind, in the suite; the benchmark tries thousands


@pytest.fixture(scope="module")
def seeds(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fuzz") / "seeds"
    write_seeds(folder)
    return folder


@pytest.mark.parametrize("mutation", MUTATIONS, ids=lambda one: one.__name__)
@pytest.mark.parametrize("data", [b"", b"a", b"time_s,a\n0.1,2.5\n0.2,3.5\n", bytes(range(256))])
def test_every_mutation_takes_every_file(mutation, data):
    results = {mutation(data, np.random.default_rng(seed)) for seed in range(20)}
    assert all(isinstance(one, bytes) for one in results)
    assert len(data) < 2 or results != {data}


def test_a_seed_gives_one_mutation():
    data = b"name = 'x'\nsize = 3.5\n" * 9
    one, same, other = (mutated(data, np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert one == same != other


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("one", SUBJECTS, ids=lambda one: one.name)
def test_mutated_files_are_read_or_refused(seeds, tmp_path, one):
    found = [outcome(one, seeds, tmp_path, 7, number) for number in range(EACH)]
    assert {each["kind"] for each in found} <= {"read", "refused"}, found
    for folder in seed_folders(seeds, one.name):
        assert (folder / target_of(folder)).exists()


def test_what_may_not_come_out_is_told_by_kind(seeds, tmp_path):
    def raising(error):
        def read(path):
            raise error

        return read

    def leaving(path):
        path.with_name("left").write_text("behind")

    kinds = {
        "escaped": raising(KeyError("x")),
        "no sentence": raising(type("Long", (BuildingError,), {"__str__": lambda e: "a\nb"})()),
        "refused": raising(BuildingError("x")),
        "left a file": leaving,
        "read": lambda path: None,
    }
    for kind, read in kinds.items():
        one = replace(subject("building"), read=read)
        assert outcome(one, seeds, tmp_path, 1, 0)["kind"] == kind


def test_a_case_can_be_made_again(seeds, tmp_path):
    one = subject("record")
    first = case(one, seeds, tmp_path / "a", 3, 41)
    again = case(one, seeds, tmp_path / "b", 3, 41)
    assert first.read_bytes() == again.read_bytes()
    assert first.name == again.name


def test_a_process_that_ends_or_hangs_is_told():
    context = run.multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    assert run._answer(ours, 0.01)["kind"] == "hung"
    theirs.close()
    assert run._answer(ours, 1.0)["kind"] == "crashed"


@pytest.mark.skipif(not os.path.exists("/proc/self/status"), reason="memory as Linux tells it")
def test_the_benchmark_counts_and_writes(tmp_path):
    report = run.run_fuzz(Job(tmp_path, 5), run.FuzzPlan(6, 1, ("building", "record")))
    assert report.answer == {"files": 6, "failures": 0}
    assert "| building | 3 |" in report.markdown.read_text(encoding="utf-8")
    assert report.content()["plan"]["files"] == 6
