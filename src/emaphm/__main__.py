"""`python -m emaphm`: the command `emaphm`, where that is not on the path."""

import sys

from emaphm.cli.entry import main

sys.exit(main())
