"""`python -m emaphm`: the command `emaphm`, for installations where it is not on the path."""

import sys

from emaphm.cli.entry import main

sys.exit(main())
