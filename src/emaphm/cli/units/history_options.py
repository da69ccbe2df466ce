"""Options of the verbs that read or write a history."""

from typing import Annotated

from cyclopts import Parameter

Database = Annotated[
    str,
    Parameter(
        name="--db",
        env_var="EMAPHM_DB",
        help="SQLite file, or postgresql://USER@HOST:PORT/DATABASE; a file 'history.sqlite' if left out.",
    ),
]
Unit = Annotated[str, Parameter(help="Serial number of the unit.")]
Hours = Annotated[float, Parameter(help="Flight hours of the unit since it was new [h].")]
Part = Annotated[str | None, Parameter(help="Only units of this part number.")]
Note = Annotated[str, Parameter(help="A sentence for the record.")]

DB = "history.sqlite"
