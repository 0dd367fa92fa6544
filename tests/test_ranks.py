"""What torchrun says of a process, and one process by itself."""

import pytest
import torch

from femupdate.ranks import ALONE, Launch, launched, together

SAID = {
    "RANK": "5",
    "WORLD_SIZE": "8",
    "LOCAL_RANK": "1",
    "LOCAL_WORLD_SIZE": "4",
    "MASTER_ADDR": "10.0.0.1",
    "MASTER_PORT": "29500",
}


def test_what_the_launcher_says():
    assert launched(SAID) == Launch(5, 8, 1, 4)


@pytest.mark.parametrize("name", SAID)
@pytest.mark.parametrize("value", [None, ""])
def test_another_program_s_variables_are_no_launch(name, value):
    assert launched({key: word for key, word in SAID.items() if key != name}) is None
    assert launched({**SAID, name: value or ""}) is None


@pytest.mark.parametrize("value", ["first", "-1", "0.5"])
def test_what_is_no_number_is_no_launch(value):
    assert launched({**SAID, "RANK": value}) is None


def test_a_process_by_itself():
    with together(None) as ranks:
        assert ranks is ALONE
        assert (ranks.number, ranks.count, ranks.device) == (0, 1, "cpu")
        assert ranks.shared("word") == "word"
        values = torch.ones(3)
        ranks.add_up([values])
        assert values.tolist() == [1.0, 1.0, 1.0]
        assert not torch.distributed.is_initialized()
