"""Tables of thresholds: each is one, stays as it is, and says where its numbers come from."""

from dataclasses import FrozenInstanceError, fields, is_dataclass
from pickle import dumps, loads

import pytest

from femupdate.discrepancy import thresholds as finder
from femupdate.inference.event_scatter import DEFAULT
from femupdate.measurement import thresholds as data


def tables(module) -> list:
    """Those of a module, in their order."""
    found = [one for one in vars(module).values() if is_dataclass(one)]
    return [one for one in found if not isinstance(one, type)]


MODULES = (data, finder)
GROUPS = (DEFAULT, *(one for module in MODULES for one in tables(module)))


@pytest.mark.parametrize("group", tables(data), ids=lambda group: type(group).__name__)
def test_a_table_is_one_and_stays_as_it_is(group):
    """Also where it is sent to another process."""
    assert loads(dumps(group)) is group
    with pytest.raises(FrozenInstanceError):
        setattr(group, fields(group)[0].name, 0)


@pytest.mark.parametrize("group", GROUPS, ids=lambda group: type(group).__name__)
def test_every_threshold_says_what_it_means_and_where_it_comes_from(group):
    told = [one for one in fields(group) if one.name != "slopes"]
    assert told
    for one in told:
        assert one.metadata["meaning"], one.name
        assert one.metadata["source"], one.name
