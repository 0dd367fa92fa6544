"""There is never more to keep than before: counts that only fall."""

import pytest

from tests import house

MARGIN = 1.005


@pytest.fixture(scope="module")
def now():
    return house.house_counts()


@pytest.mark.parametrize(("name", "limit"), house.limits().items())
def test_a_count_has_not_grown(now, name, limit):
    assert now[name] <= limit * MARGIN, (
        f"{name}: {now[name]}, at most {limit} are allowed; "
        "take something away, or say in the commit why tests/house.toml rises"
    )


def test_every_count_has_a_limit(now):
    assert list(house.limits()) == list(now)
