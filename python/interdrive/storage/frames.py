"""Tables as data frames of other libraries."""

from __future__ import annotations

import importlib.util
from typing import TYPE_CHECKING

from interdrive.errors import MissingExtraError

if TYPE_CHECKING:
    import pandas as pd
    import polars as pl

    from interdrive.storage.tables import ArrowTable


class Tabled:
    """What can become a table."""

    def to_arrow(self) -> ArrowTable:
        """As an Arrow table."""
        raise NotImplementedError

    def to_pandas(self) -> pd.DataFrame:
        """The table of `to_arrow` as a pandas data frame.

        Raises:
            MissingExtraError: pandas is not installed.
        """
        if importlib.util.find_spec("pandas") is None:
            raise MissingExtraError("to_pandas needs pandas: pip install interdrive[pandas]")
        frame: pd.DataFrame = self.to_arrow().to_pandas()
        return frame

    def to_polars(self) -> pl.DataFrame:
        """The table of `to_arrow` as a polars data frame.

        Raises:
            MissingExtraError: polars is not installed.
        """
        try:
            import polars  # noqa: PLC0415 - optional
        except ImportError:
            raise MissingExtraError("to_polars needs polars: pip install polars") from None
        frame = polars.from_arrow(self.to_arrow())
        assert isinstance(frame, polars.DataFrame)
        return frame
