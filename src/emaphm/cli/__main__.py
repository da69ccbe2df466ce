"""`python -m emaphm.cli`."""

import sys

from emaphm.cli.entry import main

sys.exit(main())
