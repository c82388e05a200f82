"""Arrow tables as data frames of libraries that need not be installed."""

from __future__ import annotations

import importlib.util
from typing import TYPE_CHECKING

from interdrive.errors import MissingExtraError

if TYPE_CHECKING:
    import pandas as pd
    import polars as pl
    import pyarrow as pa


def as_pandas(table: pa.Table) -> pd.DataFrame:
    """A table as a pandas data frame.

    Raises:
        MissingExtraError: pandas is not installed.
    """
    if importlib.util.find_spec("pandas") is None:
        raise MissingExtraError("to_pandas needs pandas: pip install interdrive[pandas]")
    frame: pd.DataFrame = table.to_pandas()
    return frame


def as_polars(table: pa.Table) -> pl.DataFrame:
    """A table as a polars data frame.

    Raises:
        MissingExtraError: polars is not installed.
    """
    try:
        import polars  # noqa: PLC0415 - optional
    except ImportError:
        raise MissingExtraError("to_polars needs polars: pip install polars") from None
    frame = polars.from_arrow(table)
    assert isinstance(frame, polars.DataFrame)
    return frame
