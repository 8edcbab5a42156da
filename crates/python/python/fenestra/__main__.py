"""``python -m fenestra`` is the program ``fenestra``."""

import sys

from . import main

sys.exit(main())
