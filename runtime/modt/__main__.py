"""`python -m modt`."""

from modt.cli.main import main

raise SystemExit(main())
