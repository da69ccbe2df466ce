"""Web pages and an HTTP API for a history: the fleet, its units, their diagnoses, uploads, data health.

`emaphm.server.run.serve` runs the server. The worker processes, in `emaphm.server.work`, load no web
framework.
"""

from importlib.util import find_spec

from emaphm.errors import ServerError

NEEDED = ("fastapi", "uvicorn", "python_multipart", "plotly", "sqlalchemy")

if any(find_spec(name) is None for name in NEEDED):
    raise ServerError("pages need further libraries; install them with: pip install 'emaphm[server]'")
