"""Groups of several rates are joined by the last value known, or one is picked."""

from __future__ import annotations

import numpy as np
import pytest

from rw_ekf.errors import EmptyLogError, LogError
from rw_ekf.logs.column_map import ColumnMap, Source
from rw_ekf.logs.foreign.groups import Group, table_of_groups

FAST = np.array([0.0, 1.0, 2.0, 3.0])


def groups() -> list[Group]:
    """A fast one, a slow one whose samples are out of order, and one without a time."""
    slow = Group("slow", np.array([2.5, 0.5]), {"T": np.array([30, 20]), "text": np.array(["a", "b"])})
    return [Group("fast", FAST, {"w": np.arange(4)}), slow, Group("notes", None, {"n": np.arange(9.0)})]


def test_groups_are_joined_onto_the_longest() -> None:
    """Each value holds until the next, nothing is known before the first, and what was done is said."""
    table = table_of_groups(groups(), ColumnMap(), "f")
    assert table.names == ("time_s", "fast.w", "slow.T")
    assert table.floats(0).tolist() == FAST.tolist()
    assert np.array_equal(table.floats(2), [np.nan, 20, 20, 30], equal_nan=True)
    assert "holds 3 groups (fast, slow, notes): all were put on the times of 'fast'" in table.warnings[0]
    assert "1 group (notes) have no time" in table.warnings[1]


def test_only_what_the_map_asks_for_is_joined() -> None:
    """Of other groups nothing else is held onto the times; everything is where the map names what is not there."""
    two = [*groups()[:2], Group("more", FAST[:2], {"x": FAST[:2]})]
    wanted = ColumnMap(sources={"speed_rad_s": Source("column", "slow.T")})
    assert table_of_groups(two, wanted, "f").names == ("time_s", "fast.w", "slow.T")
    wrong = ColumnMap(sources={"speed_rad_s": Source("column", "slow.U")})
    assert table_of_groups(two, wrong, "f").names == ("time_s", "fast.w", "slow.T", "more.x")


def test_one_group_is_picked() -> None:
    """By name, with its channels' own names; the only one without being asked; one that is not there is refused."""
    assert table_of_groups(groups(), ColumnMap(variable="slow"), "f").names == ("time_s", "T")
    assert table_of_groups(groups()[2:], ColumnMap(), "f").names == ("n",)
    own = Group("g", FAST, {"time_s": FAST + 1.0})
    assert table_of_groups([own], ColumnMap(), "f").names == ("clock_s", "time_s")
    with pytest.raises(LogError, match=r"has no 'gone'.*it holds 3 groups \(fast, slow, notes\)"):
        table_of_groups(groups(), ColumnMap(variable="gone"), "f")
    with pytest.raises(EmptyLogError, match="holds no numbers"):
        table_of_groups([Group("g", FAST[:0], {})], ColumnMap(), "f")


def test_groups_of_one_name_are_counted() -> None:
    """Two groups of the same name can be told apart."""
    same = [Group("g", FAST, {"a": FAST}), Group("g", FAST[:2], {"a": FAST[:2]})]
    assert table_of_groups(same, ColumnMap(), "f").names == ("time_s", "g[0].a", "g[1].a")
