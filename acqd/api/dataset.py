"""Datasets: built from power rows and logs, or from a table, and back to Arrow and pandas."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal, cast

from acqd.api.doubts import warn_of
from acqd.api.html import table
from acqd.api.places import Place, path_of
from acqd.api.robot import Robot
from acqd.extras import require

if TYPE_CHECKING:
    import pandas
    import pyarrow

Measured = Literal["mains", "bus", "derived", "simulated"]


class Dataset:
    """A folder of recordings: power and motion on common rows, with a split by source trajectory.

    >>> data = Dataset("ds")
    >>> data.robot, len(data.recordings), data.step_s
    ('ur10e', 9, 0.04)
    >>> frame = data.to_pandas()
    >>> list(frame.columns[:4]), str(frame["time"].dtype)
    (['recording', 'split', 'time', 'P'], 'datetime64[ns, UTC]')
    """

    def __init__(self, folder: Place) -> None:
        """Open a dataset. Raises UserError."""
        require("Dataset", ("scipy",), "data")
        from acqd.dataset.manifest import load_manifest

        self.path: Path = path_of(folder)
        self._manifest = load_manifest(self.path)

    @classmethod
    def build(
        cls,
        power: Place,
        logs: Place,
        out: Place,
        *,
        robot: Robot | Place,
        device: str | None = None,
        channel: str | None = None,
        lag_s: float | None = None,
        cut_s: float | Literal["auto"] | None = None,
        append: bool = False,
    ) -> Dataset:
        """Merge power rows (file, SQL URL, or "log") with robot logs, and find the shift of the clocks.

        `lag_s`: controller clock minus power clock, if known; `cut_s`: length of the pieces into which long logs are
        cut ("auto": chosen from the motion, None: only a single long log is cut). Warns of logs that cannot be used,
        with the reason, and of doubts. Raises UserError, InputError, OperationError.
        """
        require("Dataset.build", ("jinja2", "matplotlib", "scipy"), "data")
        from acqd.dataset.build import BuildConfig, build

        name = _name_of(robot)
        config = BuildConfig(
            str(power), path_of(logs), path_of(out), name, device, channel, lag_s=lag_s, cut_s=cut_s, append=append
        )
        report = build(config, lambda *_: None)
        warn_of([*report.refused, *report.notes])
        return cls(out)

    @classmethod
    def from_arrow(
        cls, table: pyarrow.Table, out: Place, *, robot: Robot | Place, measured: Measured = "mains"
    ) -> Dataset:
        """Write a dataset of rows that were merged elsewhere.

        Columns: `recording`, `time` (timestamps with a zone), `P` [W], `q1`.. [rad]; optional `split`, `valid`, `Vrms`
        [V], `tau1`.. [Nm], `current1`.. [A], `temperature1`.. [degC], `brake`, `tool`. Rows of a recording are
        equidistant. Raises UserError that names what is wrong.
        """
        require("Dataset.from_arrow", ("pyarrow", "scipy"), "data,parquet")
        from acqd.dataset.tables import write_table
        from acqd.errors import UserError

        if not hasattr(table, "column_names"):
            raise UserError(f"expected a pyarrow.Table, not {type(table).__name__}")
        write_table(table, path_of(out), _name_of(robot), measured)
        return cls(out)

    @classmethod
    def from_pandas(
        cls, frame: pandas.DataFrame, out: Place, *, robot: Robot | Place, measured: Measured = "mains"
    ) -> Dataset:
        """The same from a data frame."""
        require("Dataset.from_pandas", ("pandas", "pyarrow", "scipy"), "data,pandas")
        import pyarrow as pa

        from acqd.errors import UserError

        if not hasattr(frame, "columns"):
            raise UserError(f"expected a pandas.DataFrame, not {type(frame).__name__}; others: pandas.DataFrame(...)")
        if frame.columns.nlevels > 1:
            raise UserError(
                f"the columns of the data frame have {frame.columns.nlevels} levels; expected names: "
                "frame.columns = frame.columns.get_level_values(0)"
            )
        index = [name for name in frame.index.names if name in ("recording", "time") and name not in frame.columns]
        frame = frame.reset_index(index) if index else frame
        twice = frame.columns[frame.columns.duplicated()]
        if len(twice):
            raise UserError(f"the data frame has several columns {twice[0]!r}; expected one: rename the others")
        try:
            table = pa.Table.from_pandas(frame, preserve_index=False)
        except (pa.ArrowException, ValueError, TypeError) as error:
            said = "; ".join(str(each) for each in reversed(error.args)).splitlines() or [type(error).__name__]
            raise UserError(f"the data frame cannot be read: {said[0]}") from None
        return cls.from_arrow(table, out, robot=robot, measured=measured)

    @property
    def robot(self) -> str:
        """Name of the robot."""
        return str(self._manifest["robot"])

    @property
    def step_s(self) -> float:
        """Time between rows, s."""
        return float(self._manifest["step_s"])

    @property
    def measured(self) -> str:
        """Origin of the power: mains, bus, derived or simulated."""
        return str(self._manifest["measured"])

    @property
    def recordings(self) -> list[str]:
        """Names of the recordings."""
        return [str(entry["name"]) for entry in self._manifest["recordings"]]

    def to_arrow(self) -> pyarrow.Table:
        """Rows of all recordings: `recording`, `split`, `time`, and the columns that every recording has."""
        require("Dataset.to_arrow", ("pyarrow",), "parquet")
        from acqd.dataset.tables import table_of

        return table_of(self.path)

    def to_pandas(self) -> pandas.DataFrame:
        """The same as a data frame."""
        require("to_pandas", ("pandas",), "pandas")
        return cast("pandas.DataFrame", self.to_arrow().to_pandas())

    def __repr__(self) -> str:
        return f"Dataset({str(self.path)!r})"

    def _repr_html_(self) -> str:
        """For notebooks: the recordings with their parts and lengths."""
        origin = "simulated" if self.measured == "simulated" else f"power: {self.measured}"
        caption = f"{self.path.name}: {self.robot}, {len(self.recordings)} recordings, {origin}"
        rows = [
            (str(entry["name"]), str(entry["split"]), f"{entry['rows'] * self.step_s:.1f}")
            for entry in self._manifest["recordings"]
        ]
        return table(caption, ("recording", "split", "length [s]"), rows)


def _name_of(robot: Robot | Place) -> str:
    """What `load_description` takes."""
    return robot.source if isinstance(robot, Robot) else str(robot)
