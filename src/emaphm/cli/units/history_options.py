"""Options shared by the verbs that read or write a history."""

from typing import Annotated

from cyclopts import Parameter

Database = Annotated[
    str,
    Parameter(
        name="--db",
        env_var="EMAPHM_DB",
        help="Database of the history: an SQLite file, or postgresql://USER@HOST:PORT/DATABASE.",
    ),
]
Unit = Annotated[str, Parameter(help="Serial number of the unit.")]
Hours = Annotated[float, Parameter(help="Flight hours of the unit since it was new [h].")]
Part = Annotated[str | None, Parameter(help="Select only units of this part number; default all units.")]
Note = Annotated[str, Parameter(help="Remark that is stored with the entry.")]

DB = "history.sqlite"
